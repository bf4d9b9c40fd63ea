//! All integration tests, one module a subject.

mod architecture;
mod cli;
mod drape;
mod files;
mod garment;
mod interlock;
mod locate;
mod malformed;
mod map;
mod render;
