//! Every method on every hard scene.

use serde::Serialize;

use super::{
    Class, Figures, Glow, Halo, HardScene, Second, Texture, WrongPoint,
    render::{Picture, READ_NOISE, SHOT_GAIN},
    score::Tally,
};
use crate::scanner::{
    frame_index::FrameIndex,
    image::Frame,
    params::{ExtractionParams, Method, Params},
    pipeline::Pipeline,
};

/// Results of the methods on all scenes.
#[derive(Clone, Debug, Serialize)]
pub struct HardStudy {
    /// The methods, in the order of the request.
    pub methods: Vec<MethodFigures>,
    /// The scenes, in the order of the grid.
    pub scenes: Vec<SceneFigures>,
}

/// A method on all scenes.
#[derive(Clone, Debug, Serialize)]
pub struct MethodFigures {
    /// Name of the method.
    pub method: &'static str,
    /// All scenes together.
    pub all: Figures,
    /// The scenes of each class.
    pub classes: Vec<ClassFigures>,
}

/// A method on the scenes of a class.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ClassFigures {
    /// Name of the class.
    pub class: &'static str,
    /// Its scenes together.
    #[serde(flatten)]
    pub figures: Figures,
}

/// All methods on one scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneFigures {
    /// Its place in the grid.
    pub number: u32,
    /// Name of its class.
    pub class: &'static str,
    /// Direction of the line.
    pub direction: &'static str,
    /// Peak light of the line over full scale.
    pub saturation: f64,
    /// Standard deviation across the line, pixels.
    pub sigma_px: f64,
    /// Glow beside it.
    pub glow: Option<Glow>,
    /// Halo, in a colour image.
    pub halo: Option<Halo>,
    /// Second line.
    pub second: Option<Second>,
    /// Unevenness.
    pub texture: Option<Texture>,
    /// The methods, in the order of the request.
    pub methods: Vec<MethodOnScene>,
}

/// A method on one scene.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct MethodOnScene {
    /// Name of the method.
    pub method: &'static str,
    /// Its points.
    #[serde(flatten)]
    pub figures: Figures,
    /// The wrong point with the largest error; `None` if no point is wrong.
    pub worst: Option<WrongPoint>,
}

/// Measures the scenes with each method. Each scene is a scan of its own, its noise is stated to the methods. Calls
/// `on_scene` after each one.
pub fn run(
    params: &Params,
    methods: &[Method],
    scenes: &[HardScene],
    mut on_scene: impl FnMut(),
) -> HardStudy {
    let mut tallies = vec![vec![Tally::default(); Class::NAMES.len()]; methods.len()];
    let mut results = Vec::with_capacity(scenes.len());
    let mut picture = Picture::default();
    for scene in scenes {
        picture.render(scene);
        let mut on_scene_by_method = Vec::with_capacity(methods.len());
        for (&method, classes) in methods.iter().zip(&mut tallies) {
            let tally = measure(params, method, scene, &picture);
            classes[scene.class as usize].merge(&tally);
            on_scene_by_method.push(MethodOnScene {
                method: method.name(),
                figures: tally.figures(),
                worst: tally.worst(),
            });
        }
        results.push(described(scene, on_scene_by_method));
        on_scene();
    }
    let methods = methods.iter().zip(&tallies).map(|(&method, classes)| figures(method, classes));
    HardStudy { methods: methods.collect(), scenes: results }
}

fn measure(params: &Params, method: Method, scene: &HardScene, picture: &Picture) -> Tally {
    let extraction = ExtractionParams {
        method,
        read_noise: READ_NOISE,
        shot_gain: SHOT_GAIN,
        ..params.extraction
    };
    let params = Params { extraction, stripe_direction: scene.direction, ..*params };
    let mut tally = Tally::default();
    let mut pipeline = Pipeline::new(params, None);
    let Some(image) = picture.image() else { return tally };
    let frame = Frame { stamp_ns: 0, image };
    if let Ok(output) = pipeline.process(&frame, FrameIndex::default(), |_| ()) {
        tally.add(scene, output.centerline, &extraction);
    }
    tally
}

fn figures(method: Method, classes: &[Tally]) -> MethodFigures {
    let mut all = Tally::default();
    for class in classes {
        all.merge(class);
    }
    let named = Class::NAMES.iter().zip(classes);
    let classes = named.map(|(class, tally)| ClassFigures { class, figures: tally.figures() });
    MethodFigures { method: method.name(), all: all.figures(), classes: classes.collect() }
}

fn described(scene: &HardScene, methods: Vec<MethodOnScene>) -> SceneFigures {
    SceneFigures {
        number: scene.number,
        class: scene.class.name(),
        direction: scene.direction.name(),
        saturation: scene.saturation,
        sigma_px: scene.sigma_px,
        glow: scene.glow,
        halo: scene.halo,
        second: scene.second,
        texture: scene.texture,
        methods,
    }
}
