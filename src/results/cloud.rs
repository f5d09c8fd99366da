//! Rows of a point cloud of any layout.

use anyhow::{Context, ensure};

use crate::{
    msg::sensor_msgs::{PointCloud2, PointField},
    scanner::scan::Point,
};

/// The rows of a cloud with consistent lengths.
pub(super) struct Rows<'a> {
    data: &'a [u8],
    height: usize,
    width: usize,
    point_step: usize,
    row_step: usize,
    offsets: [Option<usize>; 4],
}

impl<'a> Rows<'a> {
    /// Checks a cloud with x, y and z as 32-bit floats in any layout; intensity is optional.
    ///
    /// # Errors
    /// Missing fields, big-endian numbers, inconsistent lengths.
    pub(super) fn new(cloud: &PointCloud2<'a>) -> anyhow::Result<Self> {
        ensure!(!cloud.is_bigendian, "a cloud in big endian");
        let (width, height) = (cloud.width as usize, cloud.height as usize);
        let (point_step, row_step) = (cloud.point_step as usize, cloud.row_step as usize);
        let offsets = ["x", "y", "z", "intensity"].map(|name| float_offset(cloud, name));
        for (name, offset) in ["x", "y", "z"].iter().zip(&offsets) {
            offset
                .with_context(|| format!("a cloud without the field {name} as a 32-bit float"))?;
        }
        let fits = |offset: &usize| offset.checked_add(4).is_some_and(|end| end <= point_step);
        ensure!(
            offsets.iter().flatten().all(fits),
            "a field beyond the {point_step} bytes of a point"
        );
        let wanted = row_step.checked_mul(height).context("a cloud of impossible size")?;
        let row = point_step.checked_mul(width).context("a cloud of impossible size")?;
        ensure!(
            row <= row_step && wanted <= cloud.data.len(),
            "{height} rows of {width} points need {wanted} bytes, the cloud has {}",
            cloud.data.len()
        );
        // Rows without points do not count, whatever height is stated.
        let height = if width == 0 { 0 } else { height };
        Ok(Self { data: cloud.data, height, width, point_step, row_step, offsets })
    }

    /// Returns the number of rows.
    pub(super) const fn len(&self) -> usize {
        self.height
    }

    /// Replaces `row` by a row of the cloud. Points that were not measured are NaN in all four numbers.
    pub(super) fn read(&self, at: usize, row: &mut Vec<Point>) {
        let start = at * self.row_step;
        let bytes = &self.data[start..start + self.width * self.point_step];
        row.clear();
        row.extend(bytes.chunks_exact(self.point_step).map(|point| {
            let [x, y, z, intensity] = self.offsets.map(|offset| {
                let bytes = offset.and_then(|offset| point.get(offset..)?.first_chunk::<4>());
                bytes.map_or(f32::NAN, |bytes| f32::from_le_bytes(*bytes))
            });
            if x.is_finite() && y.is_finite() && z.is_finite() {
                [x, y, z, intensity]
            } else {
                [f32::NAN; 4]
            }
        }));
    }
}

/// Returns the offset of a 32-bit float in a point, bytes.
fn float_offset(cloud: &PointCloud2<'_>, name: &str) -> Option<usize> {
    let mut fields = cloud.fields.iter();
    let field = fields.find(|field| field.name == name && field.datatype == PointField::FLOAT32)?;
    Some(field.offset as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(names: &[&'static str]) -> Vec<PointField<'static>> {
        let field = |(at, name): (usize, &&'static str)| PointField {
            name: (*name).into(),
            offset: 4 * at as u32,
            datatype: PointField::FLOAT32,
            count: 1,
        };
        names.iter().enumerate().map(field).collect()
    }

    #[test]
    fn other_layouts_are_read_by_their_description() {
        let data: Vec<u8> = [9.0, 3.0, 2.0, 1.0, 9.0, f32::NAN, 5.0, 4.0]
            .iter()
            .flat_map(|number: &f32| number.to_le_bytes())
            .collect();
        let cloud = PointCloud2 {
            height: 1,
            width: 2,
            fields: fields(&["ring", "z", "y", "x"]).into(),
            point_step: 16,
            row_step: 32,
            data: &data,
            ..PointCloud2::default()
        };
        let mut row = Vec::new();
        Rows::new(&cloud).unwrap().read(0, &mut row);
        assert_eq!(&row[0][..3], [1.0, 2.0, 3.0]);
        assert!(row[0][3].is_nan() && row[1].iter().all(|number| number.is_nan()));
        for (wrong, reason) in [
            (PointCloud2 { height: 2, ..cloud.clone() }, "need 64 bytes"),
            (PointCloud2 { point_step: 8, ..cloud.clone() }, "beyond the 8 bytes"),
            (PointCloud2 { fields: fields(&["x", "y"]).into(), ..cloud.clone() }, "field z"),
            (PointCloud2 { is_bigendian: true, ..cloud.clone() }, "big endian"),
            (
                PointCloud2 { width: u32::MAX, height: u32::MAX, row_step: u32::MAX, ..cloud },
                "bytes",
            ),
        ] {
            let error = Rows::new(&wrong).err().unwrap().to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
