//! The parameters that a node has once, however many cameras it serves.

use crate::ros::node_params::{Compression, ServiceMapping};

use super::{MIB, OFF, ON, Parameter, choice, flag, integer, text, text_list};

/// The parameter that declares those of several cameras.
pub const CAMERAS: &str = "cameras";
/// Most cameras of a node.
pub const MAX_CAMERAS: usize = 16;

const MAX_SECONDS: i64 = 366 * 24 * 3600;
const MAX_FILE_BYTES: i64 = 1 << 50;
const MAX_MEMORY_BYTES: i64 = 1 << 40;

/// In the order in which a parameter file shows them. Numbers in brackets: (default, smallest, largest).
#[rustfmt::skip]
pub const NODE: &[Parameter] = &[
    text_list(CAMERAS, MAX_CAMERAS,
        "Names of several cameras. Each has a worker of its own, its topics under its name (left/image_raw, \
         ~/left/centerline) and its parameters too (left.extraction.method). Empty: one camera without a name.")
        .read_only(),
    flag("autostart", ON,
        "Whether the node configures and activates itself. false: it waits for ~/change_state, as from a lifecycle manager.")
        .read_only(),
    flag("use_sim_time", OFF,
        "Whether the time is that of /clock, as a simulator or a player sends it, instead of the machine's."),
    choice("dds.service_mapping", "auto", ServiceMapping::NAMES,
        "How services are spoken on DDS. auto: each request is answered as it was asked, Fast DDS and Cyclone DDS side by side; \
         enhanced: all as by Fast DDS; cyclone: all as by Cyclone DDS.")
        .read_only(),
    flag("recording.enabled", OFF,
        "Whether results are recorded as long as the node is active; ~/record switches it too."),
    text("recording.directory", ".",
        "Where recordings are made, each a directory laser_profiler_<UTC time>. A relative path starts from the working directory."),
    flag("recording.images", OFF,
        "Whether the raw images are recorded too, in a bag of their own beside the results. Needs a disk that takes what the \
         cameras give: 120 MB/s for 2592 x 2048 pixels at 22 frames/s."),
    choice("recording.compression", "zstd", Compression::NAMES,
        "Compression of the results' recording. zstd: level 1, some threefold; lz4: cheaper, larger; none: for the \
         fastest disk."),
    integer("recording.split_bytes", "bytes", (0, 0, MAX_FILE_BYTES),
        "Size at which a recording goes on in its next file; 0: never. Some gigabytes suit most tools."),
    integer("recording.split_seconds", "s", (0, 0, MAX_SECONDS),
        "Duration after which a recording goes on in its next file; 0: never."),
    integer("recording.min_free_bytes", "bytes", (1024 * MIB, 0, MAX_FILE_BYTES),
        "Space that a recording leaves free on its disk: it ends before there is less. The topics go on."),
    integer("recording.queue_bytes", "bytes", (256 * MIB, MIB, MAX_MEMORY_BYTES),
        "Memory for messages that wait for the disk; what does not fit is dropped and counted. Raise it for disks that pause, \
         at 120 MB/s for a large camera's images."),
    integer("recording.snapshot_seconds", "s", (0, 0, MAX_SECONDS),
        "How much of the past is kept in memory, to be written when the snapshot service is called; 0: nothing."),
    integer("recording.snapshot_bytes", "bytes", (256 * MIB, MIB, MAX_MEMORY_BYTES),
        "Memory for that past: the oldest goes first, even when it is younger than recording.snapshot_seconds."),
];
