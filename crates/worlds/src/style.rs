//! Kinds of generated worlds, and how each is furnished.

/// Kind of a generated world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WorldKind {
    /// A street through a town, with side streets.
    Street,
    /// A motorway between barriers, under a bridge.
    Highway,
    /// Narrow streets between houses with gardens.
    Residential,
    /// Halls, containers and lorries behind a fence.
    Yard,
    /// Blocks of houses on a grid of streets with much traffic.
    Town,
}

impl WorldKind {
    /// All kinds.
    pub const ALL: [Self; 5] =
        [Self::Street, Self::Highway, Self::Residential, Self::Yard, Self::Town];

    /// Name as written on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Street => "street",
            Self::Highway => "highway",
            Self::Residential => "residential",
            Self::Yard => "yard",
            Self::Town => "town",
        }
    }

    pub(crate) fn style(self) -> Style {
        match self {
            Self::Street => STREET,
            Self::Highway => HIGHWAY,
            Self::Residential => RESIDENTIAL,
            Self::Yard => YARD,
            Self::Town => TOWN,
        }
    }
}

/// Numbers by which a network is furnished; lengths in metres, shares from 0 to 1.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    pub house: House,
    /// Metres between trees, and between lamps, along a kerb; 0 for none.
    pub trees: f64,
    pub lamps: f64,
    /// Share of plots with a hedge, and with a fence, in front.
    pub hedges: f64,
    pub fences: f64,
    /// Share of parking places taken.
    pub parked: f64,
    /// Share of lorries and buses in the traffic.
    pub heavy: f64,
    pub vehicles: usize,
    pub bicycles: usize,
    pub pedestrians: usize,
    /// Metres a second on a straight road, least and most.
    pub speed: [f64; 2],
    pub goods: bool,
}

/// How houses are built.
#[derive(Debug, Clone, Copy)]
pub struct House {
    pub width: [f64; 2],
    pub depth: [f64; 2],
    pub storeys: [u32; 2],
    /// Metres behind the walk.
    pub setback: [f64; 2],
    pub gap: [f64; 2],
    /// Share with a pitched roof.
    pub pitched: f64,
    /// Share of plots that are built on.
    pub built: f64,
}

const TOWN: Style = Style {
    house: House {
        width: [10.0, 24.0],
        depth: [9.0, 16.0],
        storeys: [2, 7],
        setback: [0.2, 2.5],
        gap: [0.0, 5.0],
        pitched: 0.3,
        built: 0.93,
    },
    trees: 14.0,
    lamps: 28.0,
    hedges: 0.05,
    fences: 0.05,
    parked: 0.7,
    heavy: 0.15,
    vehicles: 26,
    bicycles: 5,
    pedestrians: 24,
    speed: [7.0, 12.0],
    goods: false,
};

const STREET: Style = Style {
    house: House {
        width: [8.0, 20.0],
        depth: [8.0, 15.0],
        storeys: [1, 5],
        setback: [0.5, 6.0],
        gap: [0.0, 9.0],
        pitched: 0.5,
        built: 0.88,
    },
    trees: 16.0,
    hedges: 0.2,
    fences: 0.15,
    parked: 0.6,
    vehicles: 20,
    bicycles: 4,
    pedestrians: 14,
    speed: [9.0, 14.0],
    ..TOWN
};

const RESIDENTIAL: Style = Style {
    house: House {
        width: [8.0, 13.0],
        depth: [7.0, 11.0],
        storeys: [1, 2],
        setback: [4.0, 8.0],
        gap: [4.0, 12.0],
        pitched: 0.9,
        built: 0.95,
    },
    trees: 20.0,
    lamps: 35.0,
    hedges: 0.45,
    fences: 0.35,
    parked: 0.4,
    heavy: 0.08,
    vehicles: 9,
    bicycles: 3,
    pedestrians: 9,
    speed: [6.0, 9.0],
    goods: false,
};

const HIGHWAY: Style = Style {
    house: House {
        width: [18.0, 40.0],
        depth: [12.0, 25.0],
        storeys: [1, 4],
        setback: [18.0, 35.0],
        gap: [15.0, 60.0],
        pitched: 0.2,
        built: 0.4,
    },
    trees: 18.0,
    lamps: 50.0,
    hedges: 0.0,
    fences: 0.0,
    parked: 0.0,
    heavy: 0.3,
    vehicles: 40,
    bicycles: 0,
    pedestrians: 0,
    speed: [22.0, 33.0],
    goods: false,
};

const YARD: Style = Style {
    house: House {
        width: [20.0, 45.0],
        depth: [15.0, 30.0],
        storeys: [2, 3],
        setback: [5.0, 11.0],
        gap: [6.0, 22.0],
        pitched: 0.35,
        built: 0.75,
    },
    trees: 60.0,
    lamps: 40.0,
    hedges: 0.0,
    fences: 0.3,
    parked: 0.5,
    heavy: 0.7,
    vehicles: 8,
    bicycles: 1,
    pedestrians: 8,
    speed: [3.5, 6.0],
    goods: true,
};
