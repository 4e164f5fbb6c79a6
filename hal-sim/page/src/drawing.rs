//! Pictures of boxes, lines and words, where a chart's axes would say nothing.

use crate::markup::Markup;
use askama::Template;

/// Across and down, px.
pub type Point = (f64, f64);

/// Where a text's point is.
#[derive(Clone, Copy)]
pub enum Anchor {
    /// At its beginning.
    Start,
    /// At its middle.
    Middle,
    /// At its end.
    End,
}

impl Anchor {
    const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// What is drawn.
pub enum Form {
    /// A rectangle from its upper left corner, its corners rounded.
    Box {
        /// Upper left corner.
        at: Point,
        /// Width and height.
        size: Point,
        /// Of the corners.
        radius: f64,
    },
    /// A filled circle.
    Dot {
        /// Its middle.
        at: Point,
        /// Its radius.
        radius: f64,
    },
    /// Lines from point to point.
    Line(Vec<Point>),
    /// Words.
    Text {
        /// The end of their base line that `anchor` says.
        at: Point,
        /// The words.
        words: String,
        /// What of them is at the point.
        anchor: Anchor,
        /// From below to above.
        turned: bool,
        /// Heavy.
        bold: bool,
        /// Their height, if it is not the drawing's.
        px: Option<f64>,
    },
}

/// A form and how it looks.
pub struct Shape {
    /// The form.
    pub form: Form,
    /// Colour of its inside, or `none`.
    pub fill: &'static str,
    /// Colour and width of its outline; no colour is `none`.
    pub stroke: (&'static str, f64),
    /// What pointing at it says.
    pub told: String,
}

/// No outline.
pub const NO_STROKE: (&str, f64) = ("none", 0.0);

impl Shape {
    /// Words in a colour.
    pub fn text(at: Point, anchor: Anchor, fill: &'static str, words: impl Into<String>) -> Self {
        let form = Form::Text {
            at,
            words: words.into(),
            anchor,
            turned: false,
            bold: false,
            px: None,
        };
        Self {
            form,
            fill,
            stroke: NO_STROKE,
            told: String::new(),
        }
    }

    /// The same words, heavy.
    #[must_use]
    pub fn bold(mut self) -> Self {
        if let Form::Text { bold, .. } = &mut self.form {
            *bold = true;
        }
        self
    }

    /// The same words, from below to above.
    #[must_use]
    pub fn turned(mut self) -> Self {
        if let Form::Text { turned, .. } = &mut self.form {
            *turned = true;
        }
        self
    }

    /// The same words, so high.
    #[must_use]
    pub fn px(mut self, height: f64) -> Self {
        if let Form::Text { px, .. } = &mut self.form {
            *px = Some(height);
        }
        self
    }

    /// The same, and what pointing at it says.
    #[must_use]
    pub fn told(self, told: String) -> Self {
        Self { told, ..self }
    }

    /// A line of a colour and width.
    pub fn line(stroke: (&'static str, f64), points: impl Into<Vec<Point>>) -> Self {
        Self {
            form: Form::Line(points.into()),
            fill: "none",
            stroke,
            told: String::new(),
        }
    }

    /// A filled circle.
    pub fn dot(at: Point, radius: f64, fill: &'static str) -> Self {
        Self {
            form: Form::Dot { at, radius },
            fill,
            stroke: NO_STROKE,
            told: String::new(),
        }
    }

    /// A rectangle without round corners.
    pub fn rectangle(
        at: Point,
        size: Point,
        fill: &'static str,
        stroke: (&'static str, f64),
    ) -> Self {
        Self {
            form: Form::Box {
                at,
                size,
                radius: 0.0,
            },
            fill,
            stroke,
            told: String::new(),
        }
    }
}

/// A drawing of `size` px, its text `font` px high; its shapes are drawn in their order.
pub fn drawing(about: &str, size: Point, font: f64, shapes: &[Shape]) -> Markup {
    Markup::of(&Drawing {
        about,
        size,
        font,
        shapes,
    })
}

#[derive(Template)]
#[template(path = "drawing.svg")]
struct Drawing<'a> {
    about: &'a str,
    size: Point,
    font: f64,
    shapes: &'a [Shape],
}
