//! Random numbers that depend on nothing but the seed and the frame: any frame can be made at any time, on any thread.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The generator of one frame: the same for the same (seed, frame), independent of every other frame's.
pub fn frame_rng(seed: u64, frame: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(frame);
    rng
}
