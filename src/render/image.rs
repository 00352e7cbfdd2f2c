//! Images in memory: pixels, text, contact sheets and PNG files.

use super::Rgb;
use crate::storage::atomic_file;
use crate::{Error, Result};
use embedded_graphics::mono_font::iso_8859_1::{FONT_7X13, FONT_9X18_BOLD, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Line, PrimitiveStyle, Rectangle};
use embedded_graphics::text::{Baseline, Text};
use std::convert::Infallible;
use std::path::Path;

/// Size of letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Font {
    /// 7 × 13 pixels.
    Small,
    /// 10 × 20 pixels.
    Normal,
    /// 9 × 18 pixels, bold.
    Bold,
}

impl Font {
    fn mono(self) -> &'static MonoFont<'static> {
        match self {
            Font::Small => &FONT_7X13,
            Font::Normal => &FONT_10X20,
            Font::Bold => &FONT_9X18_BOLD,
        }
    }

    /// Width of `text` in pixels.
    pub fn width(self, text: &str) -> u32 {
        text.chars().count() as u32 * self.mono().character_size.width
    }

    /// Height of a line in pixels.
    pub fn height(self) -> u32 {
        self.mono().character_size.height
    }
}

/// An sRGB image; the origin is the upper left corner.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

impl Image {
    /// An image of one color, `width × height` pixels.
    pub fn new(width: u32, height: u32, color: Rgb) -> Self {
        let n_pixels = width as usize * height as usize;
        Image { width, height, rgb: color.repeat(n_pixels) }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The color at column `x`, row `y`; `None` outside.
    pub fn pixel(&self, x: u32, y: u32) -> Option<Rgb> {
        let i = self.index(i64::from(x), i64::from(y))?;
        Some([self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]])
    }

    /// Sets a pixel; nothing happens outside.
    pub fn set(&mut self, x: i64, y: i64, color: Rgb) {
        if let Some(i) = self.index(x, y) {
            self.rgb[i..i + 3].copy_from_slice(&color);
        }
    }

    fn index(&self, x: i64, y: i64) -> Option<usize> {
        let inside =
            (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y);
        inside.then(|| 3 * (y as usize * self.width as usize + x as usize))
    }

    /// All pixels, row by row, for callers that fill them in parallel.
    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.rgb
    }

    /// Copies `other` so that its upper left corner lies at `(x, y)`; what lies outside is cut off.
    pub fn paste(&mut self, other: &Image, x: i64, y: i64) {
        for row in 0..other.height {
            for column in 0..other.width {
                let i = 3 * (row as usize * other.width as usize + column as usize);
                let color = [other.rgb[i], other.rgb[i + 1], other.rgb[i + 2]];
                self.set(x + i64::from(column), y + i64::from(row), color);
            }
        }
    }

    /// Writes a line of text with its upper left corner at `(x, y)`; letters outside Latin-1 show
    /// as `?`.
    pub fn text(&mut self, x: i32, y: i32, text: &str, font: Font, color: Rgb) {
        let text = printable(text);
        let style = MonoTextStyle::new(font.mono(), rgb888(color));
        let text = Text::with_baseline(&text, Point::new(x, y), style, Baseline::Top);
        let Ok(_) = text.draw(self);
    }

    /// A straight line, `thickness` pixels wide.
    pub fn line(&mut self, from: [i32; 2], to: [i32; 2], thickness: u32, color: Rgb) {
        let line = Line::new(Point::new(from[0], from[1]), Point::new(to[0], to[1]));
        let style = PrimitiveStyle::with_stroke(rgb888(color), thickness);
        let Ok(()) = line.into_styled(style).draw(self);
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, x: i32, y: i32, width: u32, height: u32, color: Rgb) {
        let area = Rectangle::new(Point::new(x, y), Size::new(width, height));
        let Ok(()) = self.fill_solid(&area, rgb888(color));
    }

    /// A contact sheet: cells left to right, then top to bottom, each with its caption below.
    ///
    /// All cells get the size of the greatest image.
    pub fn grid(cells: &[(Image, String)], n_columns: usize) -> Image {
        let n_columns = n_columns.clamp(1, cells.len().max(1));
        let n_rows = cells.len().div_ceil(n_columns);
        let cell_width = cells.iter().map(|(i, _)| i.width).max().unwrap_or(1);
        let cell_height = cells.iter().map(|(i, _)| i.height).max().unwrap_or(1) + 18;
        let mut sheet =
            Image::new(cell_width * n_columns as u32, cell_height * n_rows as u32, [255; 3]);
        for (k, (image, caption)) in cells.iter().enumerate() {
            let x = (k % n_columns) as u32 * cell_width;
            let y = (k / n_columns) as u32 * cell_height;
            sheet.paste(image, i64::from(x), i64::from(y));
            let caption = fitted(caption, Font::Small, cell_width);
            let margin = (cell_width - Font::Small.width(&caption).min(cell_width)) / 2;
            let y = (y + cell_height - 17) as i32;
            sheet.text((x + margin) as i32, y, &caption, Font::Small, [60; 3]);
        }
        sheet
    }

    /// The image as the bytes of a PNG file.
    ///
    /// # Errors
    /// If a side is zero or the image is too large for the format.
    pub fn png(&self) -> Result<Vec<u8>> {
        self.encode().map_err(|e| {
            let size = format!("{} x {} pixels", self.width, self.height);
            Error::argument("image size", size, "a size PNG can hold", e.to_string())
        })
    }

    fn encode(&self) -> std::result::Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb)?;
        writer.finish()?;
        Ok(bytes)
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    /// If the image has no pixels or the system refuses the file.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let bytes = self.png()?;
        atomic_file::write_atomic(path, |file| std::io::Write::write_all(file, &bytes))
    }
}

/// `text` cut to `width` pixels, with two dots where it was cut.
pub fn fitted(text: &str, font: Font, width: u32) -> String {
    if font.width(text) <= width {
        return text.to_string();
    }
    let n_letters = (width / font.width("x")).saturating_sub(2) as usize;
    text.chars().take(n_letters).chain("..".chars()).collect()
}

fn printable(text: &str) -> String {
    let latin = |c: char| !c.is_control() && u32::from(c) <= 0xFF;
    text.chars().map(|c| if latin(c) { c } else { '?' }).collect()
}

fn rgb888([r, g, b]: Rgb) -> Rgb888 {
    Rgb888::new(r, g, b)
}

impl OriginDimensions for Image {
    fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }
}

impl DrawTarget for Image {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> std::result::Result<(), Infallible>
    where
        I: IntoIterator<Item = Pixel<Rgb888>>,
    {
        for Pixel(at, color) in pixels {
            self.set(at.x.into(), at.y.into(), [color.r(), color.g(), color.b()]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_reads_back_to_the_same_pixels() {
        let mut image = Image::new(40, 30, [255, 255, 255]);
        image.text(2, 2, "é→x", Font::Small, [10, 20, 30]);
        image.set(-1, 5, [1, 2, 3]);
        image.set(39, 29, [1, 2, 3]);
        let bytes = image.png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, image.rgb);
        assert_eq!(image.pixel(39, 29), Some([1, 2, 3]));
        assert_eq!(image.pixel(40, 0), None);
        assert!(pixels.chunks(3).any(|p| p == [10, 20, 30]));
        assert!(Image::new(0, 5, [0; 3]).png().is_err());
    }

    #[test]
    fn grid_places_cells_row_by_row() {
        let cell = |c| (Image::new(20, 10, [c; 3]), "a long caption".to_string());
        let sheet = Image::grid(&[cell(1), cell(2), cell(3)], 2);
        assert_eq!((sheet.width(), sheet.height()), (40, 56));
        assert_eq!(sheet.pixel(5, 5), Some([1; 3]));
        assert_eq!(sheet.pixel(25, 5), Some([2; 3]));
        assert_eq!(sheet.pixel(5, 33), Some([3; 3]));
        assert!(Image::grid(&[], 3).png().is_err());
    }

    #[test]
    fn text_too_long_is_cut() {
        assert_eq!(fitted("abcdefgh", Font::Small, 42), "abcd..");
        assert_eq!(fitted("abc", Font::Small, 42), "abc");
    }
}
