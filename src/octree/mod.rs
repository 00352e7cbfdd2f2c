//! Sparse octrees: keys, construction, neighbours, batches and kernel maps.
