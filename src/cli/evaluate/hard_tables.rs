//! Results on hard scenes as text and tables.

use super::document::{Section, Table, number, percent, px};
use crate::evaluate::hard::{
    DOUBT, Figures, HardStudy, MethodFigures, NEAR_PX, SceneFigures, WrongPoint,
};

/// Scenes with the largest share of wrong points that are listed for each method.
const NUM_EXAMPLES: usize = 3;

/// Returns the section of a study.
pub(super) fn section(study: &HardStudy) -> Section {
    Section {
        title: "Hard scenes".to_owned(),
        paragraphs: vec![format!(
            "{} rendered scenes: glow, clipping, a halo in the laser's colour, a second line, speckle, uneven surfaces. Right: within \
             {NEAR_PX} px or three of its own standard deviations of the line. In doubt: with one of the flags {DOUBT} (MULTIPLE_PEAKS, \
             CLIPPED, INTERPOLATED, LOW_CONTRAST, MISFIT). Wrong: neither, so that nothing shows it. Sound: within {NEAR_PX} px and \
             without such a flag, as a share of all columns.",
            study.scenes.len()
        )],
        tables: vec![
            methods(study),
            by_class(study, "Wrong points, %", |figures| number(100.0 * figures.wrong, 2)),
            by_class(study, "Right points, %", |figures| percent(figures.right)),
            by_class(study, "Sound columns, %", |figures| percent(figures.sound)),
            by_class(study, "RMS of the sound points, px", |figures| px(figures.sound_rms_px)),
            by_class(
                study,
                "Scatter ÷ stated standard deviation, points that are not in doubt",
                |figures| number(figures.scatter_over_sigma, 2),
            ),
            examples(study),
        ],
        plots: Vec::new(),
    }
}

fn texts<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).into()
}

fn methods(study: &HardStudy) -> Table {
    let row = |method: &MethodFigures| {
        let all = &method.all;
        vec![
            method.method.to_owned(),
            all.points.to_string(),
            percent(all.missing),
            percent(all.right),
            percent(all.doubted),
            number(100.0 * all.wrong, 2),
            number(100.0 * all.wrong_unsaturated, 2),
            percent(all.sound),
            px(all.rms_px),
            px(all.sound_rms_px),
            number(all.scatter_over_sigma, 2),
        ]
    };
    Table {
        caption: String::new(),
        header: texts([
            "method",
            "points",
            "missing %",
            "right %",
            "in doubt %",
            "wrong %",
            "wrong, not SATURATED %",
            "sound %",
            "RMS px",
            "sound RMS px",
            "scatter ÷ sigma",
        ]),
        rows: study.methods.iter().map(row).collect(),
    }
}

fn by_class(study: &HardStudy, caption: &str, cell: impl Fn(&Figures) -> String) -> Table {
    let classes = study.methods.first().map_or(&[] as &[_], |method| method.classes.as_slice());
    let heads = classes.iter().map(|class| class.class.to_owned());
    let row = |method: &MethodFigures| {
        let cells = method.classes.iter().map(|class| cell(&class.figures));
        std::iter::once(method.method.to_owned()).chain(cells).collect()
    };
    Table {
        caption: caption.to_owned(),
        header: std::iter::once("method".to_owned()).chain(heads).collect(),
        rows: study.methods.iter().map(row).collect(),
    }
}

fn examples(study: &HardStudy) -> Table {
    let mut rows = Vec::new();
    for (at, method) in study.methods.iter().enumerate() {
        let mut worst: Vec<(&SceneFigures, WrongPoint)> = study
            .scenes
            .iter()
            .filter_map(|scene| scene.methods[at].worst.map(|point| (scene, point)))
            .collect();
        worst.sort_by(|(a, _), (b, _)| {
            b.methods[at].figures.wrong.total_cmp(&a.methods[at].figures.wrong)
        });
        rows.extend(worst.iter().take(NUM_EXAMPLES).map(|(scene, point)| {
            vec![
                method.method.to_owned(),
                scene.number.to_string(),
                described(scene),
                percent(scene.methods[at].figures.wrong),
                point.along_px.to_string(),
                number(point.error_px, 2),
                px(point.sigma_px),
                point.flags.to_string(),
            ]
        }));
    }
    Table {
        caption: "Scenes with the most wrong points, and the worst point of each".to_owned(),
        header: texts([
            "method", "scene", "content", "wrong %", "column", "error px", "sigma px", "flags",
        ]),
        rows,
    }
}

/// Describes a scene in a few words.
fn described(scene: &SceneFigures) -> String {
    let glow = scene.glow.map(|glow| {
        let share = number(100.0 * glow.share, 0);
        format!("glow {share} % s {} at {}", number(glow.sigma_px, 0), number(glow.distance_px, 0))
    });
    let halo = scene.halo.map(|halo| {
        format!("halo {} % {} px", number(100.0 * halo.share, 0), number(halo.length_px, 0))
    });
    let second = scene.second.map(|second| {
        let share = number(100.0 * second.share, 0);
        format!("second {share} % at {}", number(second.distance_px, 0))
    });
    let texture = scene.texture.map(|texture| format!("{texture:?}"));
    let line = format!("{} × {}", scene.class, number(scene.saturation, 1));
    let parts: Vec<String> =
        [Some(line), glow, halo, second, texture].into_iter().flatten().collect();
    parts.join(", ")
}
