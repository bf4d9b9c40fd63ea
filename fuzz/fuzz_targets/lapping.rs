//! Chains and threadings: lines in turn are a bar's `--lapping` and its `--threading`.

#![no_main]

use std::ops::Range;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use warpknit::fabric::Fabric;
use warpknit::fabric::lapping::{Chain, Numbering};
use warpknit::fabric::threading::Threading;
use warpknit_fuzz::one_line;

static TRICOT: LazyLock<Fabric> = LazyLock::new(|| Fabric::named("tricot").expect("a built-in fabric"));

fuzz_target!(|text: &str| {
    let lines: Vec<&str> = text.split('\n').collect();
    let of_turn = |turn: usize| lines.iter().skip(turn).step_by(2).map(|line| (*line).to_owned()).collect::<Vec<_>>();
    let (chains, threadings) = (of_turn(0), of_turn(1));
    chains.iter().for_each(|chain| parse_chain(chain));
    threadings.iter().for_each(|marks| parse_threading(marks));
    match TRICOT.clone().with_chains(&chains, &threadings) {
        Ok(fabric) => {
            fabric.warnings().iter().for_each(one_line);
            assert_eq!(Fabric::parse(&fabric.to_string()).expect("what is printed is read back"), fabric);
        }
        Err(error) => {
            one_line(&error);
            error.place.iter().for_each(|place| assert_eq!(place.to_string().lines().count(), 2, "{place}"));
        }
    }
});

fn parse_chain(text: &str) {
    for numbering in [Numbering::Tricot, Numbering::Raschel] {
        match Chain::parse(text, numbering) {
            Ok(chain) => {
                assert_eq!(Chain::parse(&chain.to_string(), Numbering::Tricot).expect("what is printed is read back"), chain);
                assert_eq!(chain.mirrored().mirrored(), chain);
                let _laps = (-2..3).map(|course| (chain.lap(course), chain.underlap(course), chain.is_closed(course))).count();
            }
            Err(error) => check_span(text, &error.span),
        }
    }
}

fn parse_threading(text: &str) {
    match Threading::parse(text) {
        Ok(threading) => {
            assert_eq!(Threading::parse(&threading.to_string()).expect("what is printed is read back"), threading);
            assert!((0..threading.repeat()).any(|guide| threading.carries(i64::try_from(guide).expect("few guides"))));
        }
        Err(error) => check_span(text, &error.span),
    }
}

fn check_span(text: &str, span: &Range<usize>) {
    assert!(text.get(span.clone()).is_some(), "{span:?} is no part of {text:?}");
}
