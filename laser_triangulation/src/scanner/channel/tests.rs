use super::*;

const ALL: RegionOfInterest =
    RegionOfInterest { x_offset: 0, y_offset: 0, width: None, height: None };

fn eight(format: PixelFormat, width: u32, step: u32, data: &[u8], channel: Channel) -> Vec<u8> {
    let image = Image::new(width, data.len() as u32 / step, step, format, data).unwrap();
    let mut decoder = Decoder::default();
    match decoder.decode(
        &image,
        channel,
        &SearchedRegion::new(ALL, image.width(), image.height()).unwrap(),
    ) {
        AnyPlane::Eight(plane) => (0..plane.height).flat_map(|y| plane.row(y).to_vec()).collect(),
        AnyPlane::Sixteen(_) => panic!("8-bit image became 16 bit"),
    }
}

#[test]
fn padding_at_the_end_of_rows_is_no_pixel() {
    let data = [1, 2, 99, 3, 4, 99];
    assert_eq!(eight(PixelFormat::Mono8, 2, 3, &data, Channel::Auto), [1, 2, 3, 4]);
}

#[test]
fn every_colour_order_gives_the_same_channels() {
    let cases: [(PixelFormat, &[u8]); 4] = [
        (PixelFormat::Rgb8, &[10, 20, 30]),
        (PixelFormat::Bgr8, &[30, 20, 10]),
        (PixelFormat::Rgba8, &[10, 20, 30, 200]),
        (PixelFormat::Bgra8, &[30, 20, 10, 200]),
    ];
    for (format, data) in cases {
        let step = data.len() as u32;
        assert_eq!(eight(format, 1, step, data, Channel::Red), [10], "{format:?}");
        assert_eq!(eight(format, 1, step, data, Channel::Green), [20], "{format:?}");
        assert_eq!(eight(format, 1, step, data, Channel::Blue), [30], "{format:?}");
        assert_eq!(eight(format, 1, step, data, Channel::Max), [30], "{format:?}");
        assert_eq!(eight(format, 1, step, data, Channel::Auto), [30], "{format:?}");
        for (channel, excess) in
            [(Channel::RedExcess, 0), (Channel::GreenExcess, 0), (Channel::BlueExcess, 10)]
        {
            assert_eq!(eight(format, 1, step, data, channel), [excess], "{format:?}");
        }
        // 0.299 * 10 + 0.587 * 20 + 0.114 * 30 = 18.15
        assert_eq!(eight(format, 1, step, data, Channel::Gray), [18], "{format:?}");
    }
}

#[test]
fn sixteen_bit_samples_follow_their_byte_order_and_need_no_alignment() {
    let data = [0xff, 0x01, 0x02, 0x03, 0x04];
    for (order, expected) in
        [(ByteOrder::Little, [0x0201, 0x0403]), (ByteOrder::Big, [0x0102, 0x0304])]
    {
        let image = Image::new(2, 1, 4, PixelFormat::Mono16(order), &data[1..]).unwrap();
        let mut decoder = Decoder::default();
        let AnyPlane::Sixteen(plane) =
            decoder.decode(&image, Channel::Auto, &SearchedRegion::new(ALL, 2, 1).unwrap())
        else {
            panic!("16-bit image became 8 bit")
        };
        assert_eq!(plane.row(0), expected);
    }
}

/// A scene of one colour comes back as that colour for every pattern, borders included.
#[test]
fn a_uniform_bayer_scene_stays_uniform() {
    for pattern in [BayerPattern::Rggb, BayerPattern::Bggr, BayerPattern::Gbrg, BayerPattern::Grbg]
    {
        let rgb = [200, 100, 50];
        let data: Vec<u8> = (0..5 * 4).map(|i| rgb[colour_at(pattern, i % 5, i / 5)]).collect();
        for (channel, level) in [
            (Channel::Red, 200),
            (Channel::Green, 100),
            (Channel::Blue, 50),
            (Channel::RedExcess, 100),
        ] {
            let plane = eight(PixelFormat::Bayer8(pattern), 5, 5, &data, channel);
            assert_eq!(plane, vec![level; 20], "{pattern:?} {channel:?}");
        }
    }
}

#[test]
fn the_roi_selects_and_is_checked() {
    let data: Vec<u8> = (0..12).collect();
    let image = Image::new(4, 3, 4, PixelFormat::Mono8, &data).unwrap();
    let mut decoder = Decoder::default();
    let roi = RegionOfInterest { x_offset: 1, y_offset: 1, width: Some(2), height: None };
    let AnyPlane::Eight(plane) =
        decoder.decode(&image, Channel::Auto, &SearchedRegion::new(roi, 4, 3).unwrap())
    else {
        panic!()
    };
    assert_eq!((plane.width, plane.height, plane.row(1)), (2, 2, &[9, 10][..]));
    for roi in [
        RegionOfInterest { x_offset: 4, ..ALL },
        RegionOfInterest { x_offset: 3, width: Some(2), ..ALL },
        RegionOfInterest { y_offset: 1, height: Some(u32::MAX), ..ALL },
    ] {
        assert!(SearchedRegion::new(roi, 4, 3).is_err(), "{roi:?}");
    }
}

/// Samples that are not luma are 200 and up here.
#[test]
fn of_yuv_the_luma_is_taken() {
    let padded = [1, 201, 2, 202, 3, 203, 99, 4, 204, 5, 205, 6, 206, 99];
    for channel in [Channel::Auto, Channel::Gray, Channel::Max] {
        let plane = eight(PixelFormat::Yuyv, 3, 7, &padded, channel);
        assert_eq!(plane, [1, 2, 3, 4, 5, 6], "{channel:?}");
        let swapped = [201, 1, 202, 2, 203, 3, 99, 204, 4, 205, 5, 206, 6, 99];
        assert_eq!(eight(PixelFormat::Uyvy, 3, 7, &swapped, channel), plane, "{channel:?}");
        let plane = [1, 2, 3, 99, 4, 5, 6, 99];
        assert_eq!(eight(PixelFormat::Luma8, 3, 4, &plane, channel), [1, 2, 3, 4, 5, 6]);
    }
}

#[test]
fn a_luma_plane_is_not_copied() {
    let data = [1, 2, 3, 4];
    let image = Image::new(2, 2, 2, PixelFormat::Luma8, &data).unwrap();
    let mut decoder = Decoder::default();
    let AnyPlane::Eight(plane) =
        decoder.decode(&image, Channel::Auto, &SearchedRegion::whole(&image))
    else {
        panic!()
    };
    assert_eq!(plane.samples.as_ptr(), data.as_ptr());
}

#[test]
fn deep_colours_have_the_channels_of_shallow_ones() {
    type Deep = fn(ByteOrder) -> PixelFormat;
    let (red, green, blue, alpha) = (1000_u16, 2000, 3000, 65_535);
    let cases: [(Deep, &[u16]); 4] = [
        (PixelFormat::Rgb16, &[red, green, blue]),
        (PixelFormat::Bgr16, &[blue, green, red]),
        (PixelFormat::Rgba16, &[red, green, blue, alpha]),
        (PixelFormat::Bgra16, &[blue, green, red, alpha]),
    ];
    for (format, samples) in cases {
        for order in [ByteOrder::Little, ByteOrder::Big] {
            let bytes = |sample: &u16| match order {
                ByteOrder::Little => sample.to_le_bytes(),
                ByteOrder::Big => sample.to_be_bytes(),
            };
            // The second pixel of two, behind a padded first row.
            let pixel: Vec<u8> = samples.iter().flat_map(bytes).collect();
            let row = [vec![0; pixel.len()], pixel.clone(), vec![255; 3]].concat();
            let data = [vec![0; row.len()], row.clone()].concat();
            let image = Image::new(2, 2, row.len() as u32, format(order), &data).unwrap();
            let roi = RegionOfInterest { x_offset: 1, y_offset: 1, ..ALL };
            let region = SearchedRegion::new(roi, 2, 2).unwrap();
            for (channel, level) in [
                (Channel::Red, red),
                (Channel::Green, green),
                (Channel::Blue, blue),
                (Channel::Auto, blue),
                (Channel::BlueExcess, blue - green),
                (Channel::RedExcess, 0),
                // 0.299 * 1000 + 0.587 * 2000 + 0.114 * 3000 = 1815; the weights are rounded to 1/256.
                (Channel::Gray, 1813),
            ] {
                let mut decoder = Decoder::default();
                let AnyPlane::Sixteen(plane) = decoder.decode(&image, channel, &region) else {
                    panic!("16-bit colour became 8 bit")
                };
                assert_eq!(plane.row(0), [level], "{:?} {channel:?}", format(order));
            }
        }
    }
}

#[test]
fn a_colour_of_yuv_pixels_is_refused_by_name() {
    for format in [PixelFormat::Yuyv, PixelFormat::Uyvy, PixelFormat::Luma8] {
        for channel in [Channel::Red, Channel::Blue, Channel::GreenExcess] {
            let words = check_channel(channel, format).unwrap_err().to_string();
            assert!(words.starts_with(&format!("channel is {}, but ", channel.name())), "{words}");
            assert!(words.contains("set channel to auto or gray"), "{words}");
        }
        for channel in [Channel::Auto, Channel::Gray, Channel::Max] {
            assert_eq!(check_channel(channel, format), Ok(()));
        }
    }
    // A monochrome camera has one channel, whichever the parameters of its colour twin name.
    assert_eq!(check_channel(Channel::Red, PixelFormat::Mono8), Ok(()));
    assert_eq!(check_channel(Channel::Red, PixelFormat::Bayer8(BayerPattern::Rggb)), Ok(()));
    assert_eq!(check_channel(Channel::RedExcess, PixelFormat::Rgb16(ByteOrder::Big)), Ok(()));
}
