//! The layout of an observation as data: docs, dictionaries and policy files are made from it.

use super::settings::{AHEAD, ObservationSettings};

/// One number of an observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The block it belongs to.
    pub block: &'static str,
    /// Row within the block; 0 in a block without rows.
    pub row: usize,
    /// What it is.
    pub name: String,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// It is divided by this, then clipped to -1 to 1.
    pub scale: Scale,
}

/// What a number is divided by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// A constant.
    By(f64),
    /// A parameter of the vehicle.
    Vehicle(&'static str),
}

impl std::fmt::Display for Scale {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::By(number) => write!(f, "{number}"),
            Self::Vehicle(name) => f.write_str(name),
        }
    }
}

/// Name, unit and scale of the columns of a block.
pub(super) type Columns = &'static [(&'static str, &'static str, Scale)];

const fn by(number: f64) -> Scale {
    Scale::By(number)
}

/// What the numbers of a row are multiplied by; 1 where that depends on the vehicle.
pub(super) const fn factors<const N: usize>(columns: Columns) -> [f64; N] {
    assert!(columns.len() == N);
    let mut found = [1.0; N];
    let mut i = 0;
    while i < N {
        if let Scale::By(number) = columns[i].2 {
            found[i] = 1.0 / number;
        }
        i += 1;
    }
    found
}

/// Of the observer.
pub(super) const EGO: Columns = &[
    ("speed", "m/s", by(40.0)),
    ("acceleration", "m/s²", by(10.0)),
    ("yaw rate", "rad/s", by(1.0)),
    ("steering angle", "rad", Scale::Vehicle("steering_angle_max")),
    ("offset from the path, left positive", "m", by(10.0)),
    ("sine of heading minus that of the path", "", by(1.0)),
    ("cosine of heading minus that of the path", "", by(1.0)),
    ("curvature of the path", "1/m", by(0.2)),
    ("lateral acceleration", "m/s²", Scale::Vehicle("lateral_acceleration_max")),
    ("largest forward acceleration at this speed", "m/s²", by(12.0)),
    ("length", "m", by(20.0)),
    ("width", "m", by(4.0)),
    ("from the centre to the road edge on the left", "m", by(10.0)),
    ("from the centre to the road edge on the right", "m", by(10.0)),
    ("speed limit; 1 without one", "m/s", by(40.0)),
    ("1 beyond the ends of the path", "", by(1.0)),
];

/// Numbers of the first block of every observation: the observer.
pub(crate) const EGO_LENGTH: usize = EGO.len();

/// Of its goal.
pub(super) const GOAL: Columns = &[
    ("along the path to where it enters the goal; 1 without a position", "m", by(200.0)),
    ("along the path to where it leaves the goal; 1 without a position", "m", by(200.0)),
    ("centre of the goal ahead", "m", by(200.0)),
    ("centre of the goal to the left", "m", by(200.0)),
    ("until the goal can be reached first", "s", by(20.0)),
    ("until it can be reached in time", "s", by(20.0)),
    ("until the end of the grace period", "s", by(20.0)),
    ("lowest speed in the goal minus speed; -1 without one", "m/s", by(40.0)),
    ("highest speed in the goal minus speed; 1 without one", "m/s", by(40.0)),
    ("sine of the middle heading in the goal minus heading; 0 without one", "", by(1.0)),
    ("cosine of the middle heading in the goal minus heading; 0 without one", "", by(1.0)),
    ("1 if the goal has a position", "", by(1.0)),
];

/// Of a place on the path ahead.
pub(super) const ROUTE: Columns = &[
    ("1 if the path reaches that far", "", by(1.0)),
    ("ahead", "m", by(100.0)),
    ("to the left", "m", by(100.0)),
    ("sine of its heading minus the observer's", "", by(1.0)),
    ("cosine of its heading minus the observer's", "", by(1.0)),
    ("curvature", "1/m", by(0.2)),
    ("from the path to the road edge on the left", "m", by(10.0)),
    ("from the path to the road edge on the right", "m", by(10.0)),
];

/// Of another participant.
pub(super) const PARTNER: Columns = &[
    ("1 if there is one", "", by(1.0)),
    ("centre ahead", "m", by(80.0)),
    ("centre to the left", "m", by(80.0)),
    ("sine of its heading minus the observer's", "", by(1.0)),
    ("cosine of its heading minus the observer's", "", by(1.0)),
    ("speed", "m/s", by(40.0)),
    ("velocity minus the observer's, ahead", "m/s", by(40.0)),
    ("velocity minus the observer's, to the left", "m/s", by(40.0)),
    ("length", "m", by(20.0)),
    ("width", "m", by(4.0)),
    ("1 for a vehicle with more than two wheels", "", by(1.0)),
    ("1 for a two-wheeler", "", by(1.0)),
    ("1 for a pedestrian", "", by(1.0)),
    ("1 for anything else, and for what never moves", "", by(1.0)),
];

/// Of a piece of a road edge.
pub(super) const EDGE: Columns = &[
    ("1 if there is one", "", by(1.0)),
    ("its nearest point ahead", "m", by(50.0)),
    ("its nearest point to the left", "m", by(50.0)),
    ("sine of its direction minus the observer's heading; the road is on its right", "", by(1.0)),
    ("cosine of its direction minus the observer's heading", "", by(1.0)),
    ("half its length", "m", by(5.0)),
];

/// Of the expected drive of another participant, in the order of the partners.
pub(super) const PREDICTION: Columns = &[
    ("probability of the most probable drive", "", by(1.0)),
    ("centre ahead in 1 s", "m", by(80.0)),
    ("centre to the left in 1 s", "m", by(80.0)),
    ("standard deviation in 1 s, mean of both axes", "m", by(10.0)),
    ("centre ahead in 2 s", "m", by(80.0)),
    ("centre to the left in 2 s", "m", by(80.0)),
    ("standard deviation in 2 s, mean of both axes", "m", by(10.0)),
    ("centre ahead in 3 s", "m", by(80.0)),
    ("centre to the left in 3 s", "m", by(80.0)),
    ("standard deviation in 3 s, mean of both axes", "m", by(10.0)),
];

/// A block of an observation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Block {
    /// Its name.
    pub name: &'static str,
    /// Number of rows; `None` for a block without rows.
    pub rows: Option<usize>,
    /// Numbers per row.
    pub columns: usize,
}

impl Block {
    /// Numbers in it.
    pub fn len(&self) -> usize {
        self.rows.unwrap_or(1) * self.columns
    }

    /// There is nothing in it.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The blocks in the order of the vector, with the columns of each; those without rows are left out. `planner` is the
/// size of the block that planners with weights add, 0 without one.
fn blocks_with_columns(settings: &ObservationSettings) -> Vec<(Block, Columns)> {
    [
        ("ego", None, EGO),
        ("goal", None, GOAL),
        ("route", Some(settings.route), ROUTE),
        ("partners", Some(settings.partners), PARTNER),
        ("edges", Some(settings.edges), EDGE),
        ("predictions", Some(settings.predicted()), PREDICTION),
    ]
    .into_iter()
    .map(|(name, rows, columns)| (Block { name, rows, columns: columns.len() }, columns))
    .filter(|(block, _)| !block.is_empty())
    .collect()
}

/// The blocks in the order of the vector.
pub fn blocks(settings: &ObservationSettings, planner: &[String]) -> Vec<Block> {
    let mut found: Vec<Block> = blocks_with_columns(settings).into_iter().map(|(block, _)| block).collect();
    if !planner.is_empty() {
        found.push(Block { name: "planner", rows: None, columns: planner.len() });
    }
    found
}

/// Numbers of an observation, without the picture and without what planners with weights add.
pub fn length(settings: &ObservationSettings) -> usize {
    // Asked for in every step, so without memory.
    let rows = [settings.route, settings.partners, settings.edges, settings.predicted()];
    let columns = [ROUTE.len(), PARTNER.len(), EDGE.len(), PREDICTION.len()];
    EGO.len() + GOAL.len() + rows.iter().zip(columns).map(|(rows, columns)| rows * columns).sum::<usize>()
}

/// Every number of an observation in its order. `planner` names those of the block that planners with weights add.
pub fn layout(settings: &ObservationSettings, planner: &[String]) -> Vec<Entry> {
    let named = |block: &Block, row: usize, name: &str| {
        if block.name == "route" { format!("{name}, {} m on", AHEAD[row]) } else { name.to_owned() }
    };
    let mut found = Vec::new();
    for (block, columns) in blocks_with_columns(settings) {
        for row in 0..block.rows.unwrap_or(1) {
            found.extend(columns.iter().map(|(name, unit, scale)| Entry {
                block: block.name,
                row,
                name: named(&block, row, name),
                unit,
                scale: *scale,
            }));
        }
    }
    let added =
        planner.iter().map(|name| Entry { block: "planner", row: 0, name: name.clone(), unit: "", scale: by(1.0) });
    found.extend(added);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_observation_has_324_numbers_in_four_blocks() {
        let settings = ObservationSettings::default();
        let names: Vec<_> = blocks(&settings, &[]).iter().map(|block| (block.name, block.len())).collect();
        assert_eq!(names, [("ego", 16), ("goal", 12), ("route", 128), ("partners", 168)]);
        assert_eq!((length(&settings), layout(&settings, &[]).len()), (324, 324));
    }

    #[test]
    fn rows_that_are_not_wanted_are_left_out_and_planners_add_a_block() {
        let settings = ObservationSettings { route: 0, partners: 2, ..ObservationSettings::default() };
        let blocks: Vec<_> =
            blocks(&settings, &["weight".into()]).iter().map(|block| (block.name, block.len())).collect();
        assert_eq!(blocks[2..], [("partners", 28), ("planner", 1)]);
    }

    #[test]
    fn road_edges_and_predictions_follow_the_partners_if_they_are_wanted() {
        let wanted = ObservationSettings { edges: 32, predictions: true, ..ObservationSettings::default() };
        let found: Vec<_> = blocks(&wanted, &[]).iter().map(|block| (block.name, block.len())).collect();
        assert_eq!(found[4..], [("edges", 192), ("predictions", 120)]);
        assert_eq!((length(&wanted), layout(&wanted, &[]).len()), (324 + 312, 324 + 312));
    }
}
