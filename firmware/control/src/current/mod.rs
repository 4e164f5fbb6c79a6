//! The current loop of one motor: each PWM period.

pub mod current_loop;
pub mod encoder;
pub mod encoder_watch;
pub mod exchange;
pub mod modulation;
pub mod motor_io;
pub mod mt6835;
pub mod observer;
pub mod regulator;
pub mod sense;
pub mod transform;
