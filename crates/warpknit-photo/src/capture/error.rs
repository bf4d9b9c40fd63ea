//! Why a photo gives no yarns: the errors of capture, each with what to try.

/// What stands in the way, and what to try.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// Nothing is lighter than anything else.
    #[error("the photo is blank: take cloth that fills the picture, sharp and evenly lit")]
    Blank,
    /// Nothing repeats.
    #[error(
        "no repeat found (confidence {confidence:.2}, {least} is needed): is it velvet, fur, \
         heavily distorted or out of focus? Four copies of the pattern and more should be seen \
         each way; --cell gives the vectors of one that is hard to see"
    )]
    NoRepeat {
        /// Confidence of the best guess.
        confidence: f64,
        /// The least confidence of a repeat.
        least: f64,
    },
    /// Vectors that span no cell of a possible size.
    #[error(
        "the vectors {},{} and {},{} span no cell: give two of 3 pixels and more, neither along \
         the other, that fit the photo three times",
        .cell[0], .cell[1], .cell[2], .cell[3]
    )]
    Cell {
        /// Both vectors, pixels.
        cell: [f64; 4],
    },
    /// A repeat in which no yarn can be found.
    #[error(
        "no yarns can be told in the repeat: take a photo in which each yarn is four pixels wide \
         and more; if each is, the cloth may repeat after twice as much only, as a tight plain \
         weave does, and --cell gives the vectors of that"
    )]
    NoYarns,
    /// A given layout without a visible segment.
    #[error(
        "nothing is seen of any of the layout's segments: raise their tops, lower their sag or \
         make them longer"
    )]
    NothingVisible,
    /// A given layout whose segments reach into more cells than those of any cloth.
    #[error(
        "the layout's segments and their copies touch each cell {copies:.0} times, and may \
         {most:.0} times: make the longest, widest and most bent of them smaller, or the cell \
         larger"
    )]
    Crowded {
        /// Copies that may touch a cell.
        copies: f64,
        /// The limit of copies.
        most: f64,
    },
    /// A cloth that no fabric file can hold.
    #[error("no fabric file holds such cloth: {why}; mind --thickness and --pixels-per-mm")]
    InvalidFabric {
        /// What the reader of fabric files refuses.
        why: String,
    },
    /// A given layout whose yarns lie over each other or leave too much blank.
    #[error(
        "the layout does not cover its cell: {:.0} % lie under two segments (at most {:.0}) and \
         {:.0} % under none (at most {:.0}); move, add or delete segments",
        100.0 * .overlap, 100.0 * .most_overlap, 100.0 * .blank, 100.0 * .most_blank
    )]
    Invalid {
        /// Share of the cell under two segments.
        overlap: f64,
        /// Share of the cell under none.
        blank: f64,
        /// The limit of overlap.
        most_overlap: f64,
        /// The limit of blank.
        most_blank: f64,
    },
}
