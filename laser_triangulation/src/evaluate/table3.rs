//! Table 3 of Yao et al., "A Method for Extracting a Laser Center Line Based on an Improved Grayscale Center of Gravity
//! Method", Applied Sciences 2023, 13(17), 9831 (doi 10.3390/app13179831): row of the centre in 21 columns by three methods.

/// Column of the first entry of [`ROWS_PX`]; the others follow without gaps.
pub const FIRST_COLUMN: u32 = 1565;

/// Grey gravity, Gaussian fit and the paper's own method: row of the centre in each column, pixels.
pub const ROWS_PX: [[f64; 3]; 21] = [
    [1165.040, 1165.050, 1165.070],
    [1165.260, 1165.100, 1165.150],
    [1165.150, 1165.090, 1165.120],
    [1165.010, 1165.090, 1165.090],
    [1165.180, 1165.110, 1165.140],
    [1165.250, 1165.140, 1165.180],
    [1165.150, 1165.120, 1165.160],
    [1165.110, 1165.110, 1165.090],
    [1164.960, 1165.140, 1165.140],
    [1165.540, 1165.240, 1165.320],
    [1165.520, 1165.330, 1165.370],
    [1165.230, 1165.340, 1165.240],
    [1165.060, 1165.290, 1165.120],
    [1165.100, 1165.270, 1165.150],
    [1165.460, 1165.250, 1165.220],
    [1165.140, 1165.190, 1165.160],
    [1165.090, 1165.110, 1165.060],
    [1164.930, 1165.050, 1165.000],
    [1164.950, 1165.040, 1165.010],
    [1165.140, 1165.090, 1165.070],
    [1165.200, 1165.200, 1165.150],
];

/// Table 4 as printed, "standard error": the three methods, pixels.
pub const PRINTED_STANDARD_ERROR_PX: [f64; 3] = [0.0273, 0.0175, 0.0051];
