//! The `[[panels]]` tables of a fabric file, laid over a small garment of three panels.

#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, ReadOptions, read};
use warpknit::pipeline::turn_panels;
use warpknit_fuzz::{Desk, knit, one_line};

/// The fabric to which the tables are added: about three wales and courses a centimetre.
const FABRIC: &str = r##"name = "net"
wales_per_cm = 3.0
courses_per_cm = 4.0

[[bars]]
lapping = "1-0/1-2//"
yarn = { count = "440 dtex", density = 1.38, packing = 0.65, color = "#e3d5bd" }

"##;

/// A square, a triangle and a strip, folded when draped; centimetres.
const OBJ: &str = "v 0 0 0\nv 3 0 0\nv 3 3 1\nv 0 3 1\nv 5 0 0\nv 8 0 0\nv 5 0 3\nv 0 9 0\nv 6 9 0\nv 6 9 1\nv 0 9 1\n\
    vt 0 0\nvt 3 0\nvt 3 3\nvt 0 3\nvt 5 0\nvt 8 0\nvt 5 3\nvt 0 -9\nvt 6 -9\nvt 6 -8\nvt 0 -8\n\
    f 1/1 2/2 3/3 4/4\nf 5/5 6/6 7/7\nf 8/8 9/9 10/10\nf 8/8 10/10 11/11\n";

static GARMENT: LazyLock<Garment> = LazyLock::new(|| {
    let desk = Desk::new();
    let options = ReadOptions { unit: Some("cm".parse().expect("a unit")), ..ReadOptions::default() };
    let garment = read(&desk.file("garment.obj", OBJ.as_bytes()), None, &options).expect("a good garment");
    assert_eq!(garment.panels.len(), 3);
    garment
});

fuzz_target!(|tables: &str| {
    let fabric = match Fabric::parse(&(FABRIC.to_owned() + tables)) {
        Ok(fabric) => fabric,
        Err(error) => return one_line(&error),
    };
    let mut garment = GARMENT.clone();
    turn_panels(&mut garment, &fabric);
    // Other keys may come with the tables, and whole bars: large repeats are for the target of
    // fabrics.
    if fabric.repeat() * fabric.threading_repeat() * fabric.yarn_systems() > 60 {
        return;
    }
    if let Err(error) = knit(&garment, &fabric) {
        one_line(&error);
    }
});
