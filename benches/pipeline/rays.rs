//! Benchmarks of rays against the yarns of the shipped skirt, for the table beside Embree in
//! docs/performance.md: building, one ray a pixel of 960 x 720, and one ray to the sun from each
//! hit.
//!
//! `WARPKNIT_CAPSULES=FILE` also writes the yarns for another program: six little-endian `f32` for
//! each straight piece, its ends relative to the middle of the skirt.

use criterion::Criterion;
use glam::DVec3;
use warpknit::drape::Cloth;
use warpknit::fabric::Fabric;
use warpknit::garment;
use warpknit::render::camera::{Camera, View};
use warpknit::render::cpu::YarnRays;
use warpknit::render::{RenderOptions, cloth};

use super::cpu::CpuTime;

