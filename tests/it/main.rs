//! All integration tests, one module a subject.

mod garment;
mod interlock;
mod locate;
mod malformed;
mod map;
