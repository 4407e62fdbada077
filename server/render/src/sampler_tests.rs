//! Every sampler of the path tracer against the density it states: counts in cells of the sphere by
//! chi-square, on the device.

use std::f64::consts::PI;
use std::sync::{Arc, OnceLock};

use glam::{DMat3, DVec3};
use proto::SceneFile;
use reference::statistics::chi_square_of_counts;
use scene::{EnvironmentImage, EnvironmentImages, Scene, Volume, Voxels};
use serde_json::{Value, json};

use crate::gpu::{AdapterPolicy, Gpu, buffer_entry, texture_entry};
use crate::{environment_map, shaders, tables, uniforms};

/// Draws of a test: whole workgroups.
const SAMPLES: usize = 1 << 17;
/// Cells of the sphere: in the cosine and in azimuth.
const CELLS: [usize; 2] = [12, 16];
/// Points along each axis of a cell at which the density is looked at: for smooth densities, and
/// for those with edges.
const SMOOTH: usize = 24;
const EDGES: usize = 96;
/// A right sampler fails one test in a thousand; random numbers are fixed.
const LEVEL: f64 = 1e-3;
/// No photon becomes brighter by more where it is scattered: by up to 4 times from a lobe of half vectors,
/// and more if that reflects more than all.
const MOST_WEIGHT: f32 = 6.0;
/// Towards the eye, in the shader.
const W_O: DVec3 = DVec3::new(0.36, 0.48, 0.8);

fn gpu() -> Arc<Gpu> {
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| Gpu::open(AdapterPolicy::Any).unwrap()).clone()
}

/// What the samplers read of a scene with one material and one light.
struct Tested {
    scene: Scene,
}

impl Tested {
    fn new(patch: Value) -> Self {
        let mut file = json!({"version": 1, "volume": {"builtin": "homogeneous"}, "materials": {"m": {}}});
        for (key, value) in patch.as_object().unwrap() {
            file[key] = value.clone();
        }
        let rgb: Vec<f32> = (0..8 * 6).flat_map(|i| [(i * i % 11) as f32, 0.2, (i % 3) as f32]).collect();
        let image = Arc::new(EnvironmentImage::new(8, 6, &rgb).unwrap());
        let images: EnvironmentImages = [("sky".to_owned(), image)].into();
        let volume = scene::PreparedVolume::new(Volume::new([1; 3], Voxels::U8(vec![1])), &|_| {});
        let scene = Scene::with_images(&SceneFile::from_value(file).unwrap(), Arc::new(volume), &images);
        Self { scene: scene.unwrap() }
    }

    /// What an entry point writes: for each of `count` invocations, or for each place.
    fn run(&self, entry_point: &str, count: usize, places: &[DVec3]) -> Vec<[f32; 4]> {
        let gpu = gpu();
        let source = format!("{}\n{}", shaders::PATH_TRACE, shaders::SAMPLER_TEST);
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry_point),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: None,
            module: &module,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let buffer = |bytes: &[u8], usage| {
            let buffer =
                gpu.buffer("test", bytes.len() as u64, usage | wgpu::BufferUsages::COPY_DST).unwrap();
            gpu.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let uniform = |mut bytes: Vec<u8>, size: usize| {
            bytes.resize(size, 0);
            buffer(&bytes, wgpu::BufferUsages::UNIFORM)
        };
        let materials = tables::materials(&self.scene);
        // The scene's own material takes the place of the isotropic one.
        let materials = uniform(
            bytemuck::cast_slice(&materials[1..]).to_vec(),
            tables::MAX_MATERIALS * std::mem::size_of::<uniforms::Material>(),
        );
        let sources = uniform(
            bytemuck::cast_slice(&tables::sources(&self.scene)).to_vec(),
            tables::MAX_LIGHTS * std::mem::size_of::<uniforms::Source>(),
        );
        let frame = uniforms::FrameUniform {
            map_x: tables::vector(turned().x_axis),
            map_y: tables::vector(turned().y_axis),
            map_z: tables::vector(turned().z_axis),
            ..bytemuck::Zeroable::zeroed()
        };
        let frame = buffer(bytemuck::bytes_of(&frame), wgpu::BufferUsages::UNIFORM);
        let out = buffer(&vec![0; count * 16], wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let places: Vec<[f32; 4]> = places.iter().map(|w| w.as_vec3().extend(0.0).to_array()).collect();
        let places = buffer(bytemuck::cast_slice(&places), wgpu::BufferUsages::STORAGE);
        let (radiance, draws) = match self.scene.environment_image() {
            Some((image, _)) => (environment_map::radiance(image), environment_map::draws(image)),
            None => (vec![[0.0; 4]; 48], vec![[0.0; 4]; 48]),
        };
        let (radiance, draws) = (texture(&gpu, &radiance), texture(&gpu, &draws));
        let lights = entry_point.contains("light");
        let mut entries = vec![buffer_entry(18, &out)];
        if lights {
            entries.extend([buffer_entry(4, &sources), buffer_entry(0, &frame)]);
            entries.extend([texture_entry(20, &radiance), texture_entry(12, &draws)]);
        } else if entry_point != NUMBERS {
            entries.push(buffer_entry(3, &materials));
        }
        if entry_point.contains("densities") {
            entries.push(buffer_entry(19, &places));
        }
        let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        gpu.dispatch(&pipeline, &bind_group, [count as u32 / 64, 1]);
        bytemuck::pod_collect_to_vec(&gpu.read_buffer(&out, count as u64 * 16).unwrap())
    }

    /// Probability of counts as uneven as those of the samples, if the density is theirs. Samples
    /// that are 0 make a cell of their own, which must hold what the density leaves.
    fn p_of(&self, [sample, density]: [&str; 2], points: usize) -> f64 {
        let cells = CELLS[0] * CELLS[1];
        let mut counts = vec![0.0; cells + 1];
        for [x, y, z, _] in self.run(sample, SAMPLES, &[]) {
            let w = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
            counts[if w == DVec3::ZERO { cells } else { cell_of(w) }] += 1.0;
        }
        let size = [CELLS[0] * points, CELLS[1] * points];
        let middle = |k: usize, count: usize| (k as f64 + 0.5) / count as f64;
        let places: Vec<DVec3> = (0..size[0] * size[1])
            .map(|i| {
                let z = 2.0 * middle(i / size[1], size[0]) - 1.0;
                let (sin, cos) = (2.0 * PI * middle(i % size[1], size[1])).sin_cos();
                DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
            })
            .collect();
        let mut expected = vec![0.0; cells + 1];
        let share = 4.0 * PI / places.len() as f64 * SAMPLES as f64;
        for (i, [density, ..]) in self.run(density, places.len(), &places).into_iter().enumerate() {
            let (ring, sector) = (i / size[1] / points, i % size[1] / points);
            expected[ring * CELLS[1] + sector] += f64::from(density) * share;
        }
        let inside: f64 = expected.iter().sum();
        expected[cells] = (SAMPLES as f64 - inside).max(0.0);
        chi_square_of_counts(&counts, &expected)
    }
}

/// A 8 x 6 texture.
fn texture(gpu: &Gpu, texels: &[[f32; 4]]) -> wgpu::TextureView {
    let size = wgpu::Extent3d { width: 8, height: 6, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(8 * 16), rows_per_image: Some(6) };
    gpu.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(texels), layout, size);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Where the map's axes are in the world.
fn turned() -> DMat3 {
    DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(0.4)
}

fn cell_of(w: DVec3) -> usize {
    let ring = ((0.5 * (w.z + 1.0) * CELLS[0] as f64) as usize).min(CELLS[0] - 1);
    let turn = w.y.atan2(w.x).rem_euclid(2.0 * PI) / (2.0 * PI);
    ring * CELLS[1] + ((turn * CELLS[1] as f64) as usize).min(CELLS[1] - 1)
}

const DIRECTIONS: [&str; 2] = ["sample_directions", "direction_densities"];
const WAYS_ON: [&str; 2] = ["sample_ways_on", "way_on_densities"];
const EVENLY: &str = "sample_lights_evenly";
const NUMBERS: &str = "even_numbers";
const LIGHTS: [&str; 2] = ["sample_lights", "light_densities"];

fn material(material: Value) -> Tested {
    Tested::new(json!({"materials": {"m": material}}))
}

#[test]
fn directions_are_chosen_as_their_density_says() {
    let hg = |g: f64| json!({"phase": {"type": "henyey_greenstein", "g": g}});
    let schlick = |k: f64| json!({"phase": {"type": "schlick", "k": k}});
    let surface = |weight: f64, brdf: Value| json!({"surface": weight, "brdf": brdf});
    let ashikhmin = |exponents: [f64; 2]| json!({"type": "ashikhmin_shirley", "diffuse": 0.6, "specular": 0.3, "exponents": exponents});
    let abc = |a: f64, b: f64, c: f64| json!({"type": "abc", "diffuse": 0.2, "a": a, "b": b, "c": c});
    let blinn = |e: f64| json!({"type": "blinn_phong", "diffuse": 0.4, "specular": 0.5, "exponent": e});
    let materials = [
        json!({}),
        hg(0.6),
        hg(-0.4),
        hg(1e-6),
        schlick(0.7),
        schlick(-0.3),
        surface(1.0, json!({"type": "lambert", "diffuse": 0.8})),
        surface(1.0, blinn(0.0)),
        surface(1.0, blinn(20.0)),
        surface(0.5, blinn(60.0)),
        surface(1.0, ashikhmin([8.0, 8.0])),
        surface(1.0, ashikhmin([5.0, 40.0])),
        surface(1.0, ashikhmin([0.0, 0.0])),
        surface(1.0, abc(0.3, 20.0, 1.5)),
        surface(1.0, abc(0.3, 20.0, 1.0)),
        surface(1.0, abc(0.3, 0.0, 2.0)),
        surface(0.7, abc(0.3, 1e-3, 2.0)),
    ];
    for description in materials {
        let tested = material(description.clone());
        for which in [DIRECTIONS, WAYS_ON] {
            let p = tested.p_of(which, SMOOTH);
            assert!(p > LEVEL, "{description}: {which:?}: p = {p}");
        }
        // Ways that are chosen by their cosine, which what arrives there does not have, weigh 100 and more.
        let weights = tested.run(WAYS_ON[0], SAMPLES, &[]).into_iter().map(|[.., weight]| weight);
        let heaviest = weights.fold(0.0, f32::max);
        assert!((0.1..MOST_WEIGHT).contains(&heaviest), "{description}: a photon grows {heaviest} times");
    }
}

#[test]
fn narrow_lobes_have_their_distribution() {
    const BINS: usize = 32;
    for g in [0.999_f64, -0.999, 0.99, 0.9] {
        let tested = material(json!({"phase": {"type": "henyey_greenstein", "g": g}}));
        let ahead = -W_O.as_vec3().as_dvec3() * g.signum();
        let m = g.abs();
        let mut counts = [0.0; BINS];
        for [x, y, z, _] in tested.run("sample_directions", SAMPLES, &[]) {
            let w = DVec3::new(f64::from(x), f64::from(y), f64::from(z)).normalize();
            // Share of the lobe closer to its middle, from 1 - cos = |w - ahead|^2 / 2.
            let versine = 0.5 * (w - ahead).length_squared();
            let root = ((1.0 - m).powi(2) + 2.0 * m * versine).sqrt();
            let share = 1.0 - (1.0 - m) * (1.0 + m - root) / (2.0 * m * root);
            counts[((share * BINS as f64) as usize).min(BINS - 1)] += 1.0;
        }
        let p = chi_square_of_counts(&counts, &[SAMPLES as f64 / BINS as f64; BINS]);
        assert!(p > LEVEL, "g = {g}: p = {p}, {counts:?}");
    }
}

#[test]
fn lights_are_looked_for_as_their_density_says() {
    let lights = [
        (
            json!({"type": "rectangle", "center": [0.2, 0.9, 0.1], "normal": [0.1, -1, 0.2], "up": [0, 0, 1], "size": [1.4, 0.9], "radiance": [1, 1, 1]}),
            EDGES,
        ),
        (
            json!({"type": "disk", "center": [0.9, 0.1, 0.2], "normal": [-1, 0.2, 0], "radius": 0.8, "radiance": [1, 1, 1]}),
            EDGES,
        ),
        (json!({"type": "sphere", "center": [-0.6, 0.3, -0.4], "radius": 0.6, "radiance": [1, 1, 1]}), EDGES),
        (json!({"type": "environment", "radiance": [1, 1, 1]}), SMOOTH),
        (json!({"type": "environment", "image": "sky"}), EDGES),
    ];
    for (light, points) in lights {
        let tested = Tested::new(json!({"lights": [light]}));
        let p = tested.p_of(LIGHTS, points);
        assert!(p > LEVEL, "{light}: p = {p}");
        // The density that comes with a sample is the one stated for its direction.
        let samples = tested.run(LIGHTS[0], 64, &[]);
        let places: Vec<DVec3> = samples
            .iter()
            .map(|[x, y, z, _]| DVec3::new(f64::from(*x), f64::from(*y), f64::from(*z)))
            .collect();
        let stated = tested.run(LIGHTS[1], 64, &places);
        let agree = samples.iter().zip(&stated).filter(|(a, b)| (a[3] - b[0]).abs() <= 1e-3 * a[3]).count();
        // A direction at the edge of a light or a texel may fall beside it.
        assert!(agree >= 62, "{light}: {agree} of 64 densities agree");
    }
}

#[test]
fn directions_of_an_image_are_even() {
    let tested = Tested::new(json!({"lights": [{"type": "environment", "image": "sky"}]}));
    // More even than random ones, whose counts would be as uneven as this or more so in half of all tests.
    let p = tested.p_of([EVENLY, LIGHTS[1]], EDGES);
    assert!(p > 0.999, "p = {p}");
}

/// A box that is cut out by halving the cube nine times holds eight of 2^12 numbers that follow one another,
/// along whichever axes it is cut: a (3, 12, 4)-net in base 2. In the first two dimensions of 2^12 boxes each
/// holds one.
#[test]
fn numbers_are_even_in_all_boxes() {
    let numbers = Tested::new(json!({})).run(NUMBERS, 2 << 12, &[]);
    for numbers in numbers.chunks(1 << 12) {
        let counts = |halvings: [u32; 4]| {
            let mut counts = vec![0; 1 << halvings.iter().sum::<u32>()];
            for number in numbers {
                let place = |index: usize, axis: usize| {
                    let part = (number[axis] * (1 << halvings[axis]) as f32) as usize;
                    index << halvings[axis] | part
                };
                counts[(0..4).fold(0, place)] += 1;
            }
            counts
        };
        for cut in 0..10_u32.pow(3) {
            let [a, b, c] = [cut % 10, cut / 10 % 10, cut / 100];
            if a + b + c <= 9 {
                let halvings = [a, b, c, 9 - a - b - c];
                assert!(counts(halvings).iter().all(|&count| count == 8), "{halvings:?}");
            }
        }
        for a in 0..=12 {
            assert!(counts([a, 12 - a, 0, 0]).iter().all(|&count| count == 1), "{a}");
        }
    }
}

#[test]
fn wrong_densities_are_noticed() {
    let narrow = material(json!({"phase": {"type": "henyey_greenstein", "g": 0.6}}));
    let wide = material(json!({"phase": {"type": "henyey_greenstein", "g": 0.57}}));
    let counts = |tested: &Tested| {
        let mut counts = vec![0.0; CELLS[0] * CELLS[1]];
        for [x, y, z, _] in tested.run(DIRECTIONS[0], SAMPLES, &[]) {
            counts[cell_of(DVec3::new(f64::from(x), f64::from(y), f64::from(z)))] += 1.0;
        }
        counts
    };
    assert!(chi_square_of_counts(&counts(&narrow), &counts(&wide)) < 1e-9);
}
