//! What the later papers report. Their abstracts were read. Their figures and tables were not available.

/// A paper, and what of it the simulation is compared with.
pub struct Paper {
    /// Where it stands.
    pub reference: &'static str,
    /// What it reports, in our words.
    pub reports: &'static str,
    /// What of it was not available.
    pub missing: &'static str,
}

/// Creeping.
pub const CREEP: Paper = Paper {
    reference: "Wang, Feng, Yang, Jin, Mech. Sci. 12, 791 (2021), doi 10.5194/ms-12-791-2021",
    reports: "In simulation with LuGre friction the table has a lower stable velocity with the double drive. Both of its motors turn faster \
              than the speed at which the single drive's screw begins to creep.",
    missing: "Its velocities, friction and curves were not available.",
};

/// A sine at creep speed.
pub const TRACKING: Paper = Paper {
    reference: "Shock and Vibration 2022, 3915600",
    reports: "On a double drive, adaptive compensation of LuGre friction makes the tracking ten times as accurate as a PID controller does.",
    missing: "Its amplitudes, frequencies and curves were not available.",
};

/// Losses.
pub const WARMTH: [Paper; 2] = [
    Paper {
        reference: "Science Progress 2019, doi 10.1177/0036850419875667",
        reports: "It computes the motion of the balls, their friction and the efficiency of a screw whose nut is driven too.",
        missing: "Its abstract has no figure of losses or heat, and its curves were not available.",
    },
    Paper {
        reference: "Int. J. Adv. Manuf. Technol. 2024, doi 10.1007/s00170-024-13408-y",
        reports: "The nut's bearing and motor are two more sources of heat, which move. The double drive therefore makes more heat.",
        missing: "Its figures were not available.",
    },
];

/// A load that switches.
pub const SWITCHING: Paper = Paper {
    reference: "Advances in Mechanical Engineering 2018, doi 10.1177/1687814018774628",
    reports: "The load moves from motor to motor where the table reverses. A cross-coupled sliding-mode controller with a neural estimate of \
              the friction reduces the position error by 45 % against a single drive.",
    missing: "Its gains, loads and curves were not available.",
};

/// Torsion of the screw.
pub const TORSION: Paper = Paper {
    reference: "Science Progress 2021, doi 10.1177/00368504211031387",
    reports: "A beam with axial and torsional freedom describes the screw. In simulation a double drive feeds better at low speed than a \
              single drive.",
    missing: "Its frequencies, its screw and its curves were not available.",
};
