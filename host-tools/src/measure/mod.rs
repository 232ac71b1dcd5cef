//! How far two materials are apart, how fast they are sampled, and what the encoders are measured against.

pub mod baseline;
pub mod compare;
pub mod radiance;
pub mod similarity;
pub mod speed;
pub mod verify;
