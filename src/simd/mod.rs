//! Vector kernels and the choice between them: the only room with unsafe code.
#![allow(unsafe_code)]
