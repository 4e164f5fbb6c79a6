//! Why a drive could not be aligned.

use crate::base::fault::Part;
use crate::codes;

codes! {
    /// What stands in the way of an alignment. In the debug view 0 is nothing.
    Reason {
        NoCurrent = 1, "no current flows",
            "A voltage on its phases makes no current: connect the motor, enable the gate driver, check the bus.";
        OpenPhaseA = 2, "phase a open",
            "No current passes phase a: check its cable and its bridge leg.";
        OpenPhaseB = 3, "phase b open",
            "No current passes phase b: check its cable and its bridge leg.";
        OpenPhaseC = 4, "phase c open",
            "No current passes phase c: check its cable and its bridge leg.";
        SignA = 5, "sign of current a",
            "The current of phase a is measured with the wrong sign: turn its sensor round, or its gain on the plate.";
        SignB = 6, "sign of current b",
            "The current of phase b is measured with the wrong sign: turn its sensor round, or its gain on the plate.";
        SignC = 7, "sign of current c",
            "The current of phase c is measured with the wrong sign: turn its sensor round, or its gain on the plate.";
        SignAll = 8, "sign of all currents",
            "All currents are measured with the wrong sign: a low-side shunt behind a non-inverting amplifier needs a negative gain on the plate.";
        ChannelsAb = 9, "current channels a and b exchanged",
            "The current channels of phases a and b are exchanged: swap them.";
        ChannelsBc = 10, "current channels b and c exchanged",
            "The current channels of phases b and c are exchanged: swap them.";
        ChannelsCa = 11, "current channels c and a exchanged",
            "The current channels of phases c and a are exchanged: swap them.";
        ChannelsRotated = 12, "current channels one phase on",
            "Each current channel belongs to the next phase: put the three in order.";
        DeadChannelA = 13, "current channel a dead",
            "The current channel of phase a reads nothing while current flows: check its shunt and amplifier.";
        DeadChannelB = 14, "current channel b dead",
            "The current channel of phase b reads nothing while current flows: check its shunt and amplifier.";
        DeadChannelC = 15, "current channel c dead",
            "The current channel of phase c reads nothing while current flows: check its shunt and amplifier.";
        Wiring = 16, "phases and currents do not belong together",
            "Voltages and currents of its phases do not belong together: check shunts, channels and phases one by one.";
        LoadMoves = 17, "load not held",
            "Its encoder moves although no current flows: hold the load by a brake, or take it off, and reset; if it stands still, look \
             for what disturbs the encoder.";
        Held = 18, "rotor held",
            "The torque of its setting `alignment_torque_nm` does not move its encoder, or does not turn both motors together by thirty \
             electrical degrees: release the brake, check the encoder's cable, or raise the setting.";
        Unsteady = 19, "rotor not to be found",
            "Where it stands cannot be told from how it moves: check the encoder's fixing, its signals and index, the motor's \
             current sensors, and for play, and reset.";
        Reversed = 20, "encoder counts against the phases",
            "Its encoder counts against the order of its phases: swap two phases, or the encoder's channels, or say so on the plate.";
        PolePairs = 21, "pole pairs",
            "It has another number of pole pairs than its plate says.";
        StoredAngle = 22, "stored angle",
            "Its encoder's stored electrical angle is not where the rotor is: was the encoder moved, or phases changed? Store the angle anew.";
        Exchanged = 23, "encoders exchanged",
            "The motors move each other's encoders: exchange the encoders' connectors, or the motors'.";
        Opposed = 24, "motors turn against each other",
            "Positive torques turn the motors against each other: swap two phases and the encoder's channels of one.";
        Travel = 25, "table moved",
            "The table moved further than the setting `alignment.travel_um` lets alignment move it, by its scale or by both encoders: check \
             coupling, encoders and scale, and that the load is held.";
        TimedOut = 26, "not found in time",
            "The rotors were not found within 30 s: check that the load is held and that nothing moves the table, and reset.";
    }
}

/// What stopped an alignment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Misalignment {
    /// Whose.
    pub part: Part,
    /// Why.
    pub reason: Reason,
}
