//! Tables, coloured point clouds and pictures: shows, never computes.
