//! All integration tests, one module a subject.

mod garment;
mod malformed;
