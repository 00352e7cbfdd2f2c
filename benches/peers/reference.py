"""The reference structure in PyTorch: the U-Net of PyPI's ocnn with cutter features and two heads."""


def network(torch, ocnn, cutter_module, cutter_width, **widths):
    """The network with random weights; `widths` replaces settings of ocnn's U-Net.

    `cutter_module()` makes a module from [n, 4] to [n, cutter_width]; each stage of the decoder has one.
    """

    class Network(ocnn.models.UNet):
        def config_network(self):
            super().config_network()
            for name, value in widths.items():
                setattr(self, name, value)

        def __init__(self):
            super().__init__(4, 2)
            c, skip = self.decoder_channel, self.encoder_channel[-2::-1]
            self.decoder = torch.nn.ModuleList([
                ocnn.modules.OctreeResBlocks(
                    skip[i] + cutter_width + c[i + 1], c[i + 1], self.decoder_blocks[i],
                    self.bottleneck, self.nempty, self.resblk)
                for i in range(self.decoder_stages)])
            self.cutters = torch.nn.ModuleList([cutter_module() for _ in range(self.decoder_stages)])
            self.header_2 = torch.nn.Sequential(
                ocnn.modules.Conv1x1BnRelu(c[-1], self.head_channel),
                ocnn.modules.Conv1x1(self.head_channel, 2, use_bias=True))

        def forward(self, data, octree, depth, query, cutter):
            skips = self.unet_encoder(data, octree, depth)
            x = skips[depth - self.encoder_stages]
            for i in range(self.decoder_stages):
                d = depth - self.encoder_stages + i
                x = self.upsample[i](x, octree, d)
                seen = self.cutters[i](cutter)[octree.batch_id(d + 1, self.nempty).long()]
                x = self.decoder[i](torch.cat([skips[d + 1], seen, x], dim=1), octree, d + 1)
            x = self.octree_interp(x, octree, depth, query)
            return self.header(x), self.header_2(x)

    return Network()
