//! Where the names of points stand on a chart, so that none covers another or what is drawn.

use crate::scale::{TEXT, units};

/// Places taken on a chart.
pub struct Places {
    /// Nothing stands outside it.
    pub frame: Area,
    /// What is drawn: left clear where possible.
    pub drawn: Vec<Area>,
    /// Names that stand already.
    pub names: Vec<Area>,
}

impl Places {
    /// Middle of the place for the name of the point `at`, which is then taken; none where all are.
    pub fn take(&mut self, name: &str, at: (i32, i32)) -> Option<(i32, i32)> {
        let width = units(0.62 * TEXT * name.chars().count() as f64);
        let free =
            |area: &Area| within(area, &self.frame) && !self.names.iter().any(|n| overlap(area, n));
        let clear = |area: &Area| free(area) && !self.drawn.iter().any(|d| overlap(area, d));
        let places: Vec<Area> = places(at, width).collect();
        let found = places.iter().find(|p| clear(p));
        let area = *found.or_else(|| places.iter().find(|p| free(p)))?;
        self.names.push(area);
        Some(((area[0] + area[2]) / 2, (area[1] + area[3]) / 2))
    }
}

/// Left, top, right and bottom in the drawing's units.
pub type Area = [i32; 4];

/// What reaches so far around a point.
pub fn around((x, y): (i32, i32), half_width: i32, half_height: i32) -> Area {
    [
        x - half_width,
        y - half_height,
        x + half_width,
        y + half_height,
    ]
}

fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

fn within(a: &Area, frame: &Area) -> bool {
    a[0] >= frame[0] && a[1] >= frame[1] && a[2] <= frame[2] && a[3] <= frame[3]
}

/// Where the name of a point may stand, best first: around the point, then around it farther off.
fn places((x, y): (i32, i32), width: i32) -> impl Iterator<Item = Area> {
    let height = units(TEXT);
    [6.0, 14.0, 24.0].into_iter().flat_map(move |px| {
        let (dx, dy) = (units(px) + width / 2, units(px) + height / 2);
        [
            (dx, -dy),
            (-dx, dy),
            (dx, 0),
            (-dx, 0),
            (0, -dy),
            (0, dy),
            (-dx, -dy),
            (dx, dy),
        ]
        .map(|(dx, dy)| around((x + dx, y + dy), width / 2, height / 2))
    })
}
