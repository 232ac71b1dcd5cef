//! Runs the kernel on an adapter: materials in one buffer, lists of queries, answers word for word.

use crate::error::{Result, ToolError};
use crate::math::random::Random;
use selvedge::{Direction, Rgb, Selvedge, Values};
use selvedge_shaders::{Request, assemble};
use std::collections::BTreeMap;
use std::sync::Mutex;
use wgpu::util::DeviceExt as _;

/// A question to the kernel; what the words mean depends on the entry point (see `entries.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Query {
    /// Number of the material.
    pub material: u32,
    /// Position along x.
    pub u: u32,
    /// Position along y.
    pub v: u32,
    /// Level in Q16.
    pub level_q16: u32,
    /// Light direction.
    pub light: [u32; 3],
    /// View direction.
    pub view: [u32; 3],
}

/// The kernel's answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Answer {
    /// Radiance as binary32 bits.
    pub rgb: [u32; 3],
    /// Channel values, Q20.
    pub values: [i32; 3],
}

impl Answer {
    /// From the core's results.
    pub fn new(rgb: Rgb, values: Values) -> Answer {
        Answer { rgb: rgb.to_words(), values: [values.c0, values.c1, values.c2] }
    }
}

/// The words of a direction in a query.
pub fn direction_words(direction: Direction) -> [u32; 3] {
    [direction.x_q18 as u32, direction.y_q18 as u32, direction.z_q15 as u32]
}

/// What the core answers to a query of an entry point.
pub fn answer_on_cpu(material: &Selvedge<'_>, entry: &str, query: &Query) -> Answer {
    use selvedge::kernel::direction::direction_from_binary32;
    use selvedge::kernel::interpolation::{filtered_values, light_sample, radiance};
    use selvedge::kernel::levels::trilinear_values;
    use selvedge::kernel::position::fraction_from_binary32;
    let (words, m) = (material.words(), material.material());
    let [lx, ly, lz] = query.light;
    let [vx, vy, vz] = query.view;
    if entry == "texel" {
        let values = material.point_values(query.u, query.v, lx, vx);
        return Answer::new(radiance(m, values, &light_sample(words, m, lx)), values);
    }
    let direction = |[x, y, z]: [u32; 3]| Direction { x_q18: x as i32, y_q18: y as i32, z_q15: z as i32 };
    let floats = entry == "floats";
    let of = |x, y, z| if floats { direction_from_binary32(x, y, z) } else { direction([x, y, z]) };
    let (light, view) = (material.locate_light(of(lx, ly, lz)), material.locate_view(of(vx, vy, vz)));
    let values = match entry {
        "filtered" => filtered_values(words, m, 0, query.u, query.v, &light, &view),
        "floats" => {
            let (u, v) = (fraction_from_binary32(query.u), fraction_from_binary32(query.v));
            trilinear_values(words, m, query.level_q16, u, v, &light, &view)
        }
        _ => trilinear_values(words, m, query.level_q16, query.u, query.v, &light, &view),
    };
    Answer::new(radiance(m, values, &light), values)
}

/// Backends by name: `vulkan`, `gl`, or all for anything else.
pub fn backends(name: &str) -> wgpu::Backends {
    match name {
        "vulkan" => wgpu::Backends::VULKAN,
        "gl" => wgpu::Backends::GL,
        _ => wgpu::Backends::all(),
    }
}

/// What a pipeline is compiled for: methods by name, and an entry point.
type PipelineKey = (Vec<&'static str>, String);

/// An adapter, and the pipelines that were asked for so far.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    layout: wgpu::BindGroupLayout,
    pipeline_layout: wgpu::PipelineLayout,
    pipelines: Mutex<BTreeMap<PipelineKey, wgpu::ComputePipeline>>,
    /// Name, backend and kind of the adapter.
    pub description: String,
}

/// Materials on the device.
pub struct Loaded {
    files: wgpu::Buffer,
    materials: wgpu::Buffer,
    /// Methods that the materials have: what a kernel for them is assembled of.
    methods: Vec<&'static str>,
}

impl Gpu {
    /// The best adapter there is: a native one, else GL, else `None`.
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn any() -> Result<Option<Gpu>> {
        match Gpu::new(wgpu::Backends::PRIMARY)? {
            Some(gpu) => Ok(Some(gpu)),
            None => Gpu::new(wgpu::Backends::GL),
        }
    }

    /// The first adapter of the backends; `None` if there is none. A software adapter will do.
    ///
    /// # Errors
    /// [`ToolError::Kernel`] if the adapter gives no device.
    pub fn new(backends: wgpu::Backends) -> Result<Option<Gpu>> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = backends;
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let Ok(adapter) = pollster::block_on(instance.request_adapter(&options)) else {
            return Ok(None);
        };
        let info = adapter.get_info();
        let limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < 4 {
            return Ok(None);
        }
        let required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size.min(1 << 30),
            max_buffer_size: limits.max_buffer_size.min(1 << 30),
            ..wgpu::Limits::downlevel_defaults()
        };
        let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|e| ToolError::Kernel(e.to_string()))?;
        let entries: Vec<wgpu::BindGroupLayoutEntry> = (0..4)
            .map(|binding| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: binding < 3 },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        let layout = device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let description = format!("{} ({:?}, {:?})", info.name, info.backend, info.device_type);
        let pipelines = Mutex::default();
        Ok(Some(Gpu { device, queue, layout, pipeline_layout, pipelines, description }))
    }

    /// Puts materials into one buffer, each with its dictionary behind it.
    pub fn load(&self, materials: &[Selvedge<'_>]) -> Loaded {
        let mut files: Vec<u8> = Vec::new();
        let mut records = Vec::new();
        let of = |method: &&selvedge_shaders::Method| {
            materials.iter().any(|material| material.material().method == method.number)
        };
        let methods = selvedge_shaders::METHODS.iter().filter(of).map(|method| method.name).collect();
        for material in materials {
            let words = material.words();
            let file_start = files.len() / 4;
            files.extend(words.file);
            let dictionary_start = files.len() / 4;
            files.extend(words.dictionary);
            records.extend(material.material_at(file_start as u32, dictionary_start as u32).to_words());
        }
        // One word past the end may be read by a window.
        files.extend([0; 16]);
        let buffer = |label, contents: &[u8]| {
            self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage: wgpu::BufferUsages::STORAGE,
            })
        };
        Loaded {
            files: buffer("files", &files),
            materials: buffer("materials", bytemuck::cast_slice(&records)),
            methods,
        }
    }

    /// The pipeline of an entry point for the methods of some materials, compiled when it is first asked for.
    ///
    /// The shader has nothing else in it, since compilers of drivers take seconds for what is never called.
    ///
    /// # Errors
    /// [`ToolError::Kernel`] if there is no such entry point.
    fn pipeline(&self, loaded: &Loaded, entry: &str) -> Result<wgpu::ComputePipeline> {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let key = (loaded.methods.clone(), entry.to_owned());
        if let Some(pipeline) = pipelines.get(&key) {
            return Ok(pipeline.clone());
        }
        let request = Request::new(&loaded.methods, &[entry]);
        let source = assemble(&request.map_err(|unknown| ToolError::Kernel(unknown.to_string()))?);
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("selvedge"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&self.pipeline_layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        });
        pipelines.insert(key, pipeline.clone());
        Ok(pipeline)
    }

    fn run(
        &self,
        loaded: &Loaded,
        entry: &str,
        queries: &[Query],
        answers: usize,
        groups: [u32; 2],
    ) -> Result<Vec<Answer>> {
        let pipeline = self.pipeline(loaded, entry)?;
        let contents = bytemuck::cast_slice(queries);
        let query_buffer = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("queries"),
            contents,
            usage: wgpu::BufferUsages::STORAGE,
        });
        let size = (answers * size_of::<Answer>()) as u64;
        let answer_buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("answers"),
            size,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let read_buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read"),
            size,
            usage,
            mapped_at_creation: false,
        });
        let buffers = [&loaded.files, &loaded.materials, &query_buffer, &answer_buffer];
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0u32..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.layout,
            entries: &entries,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        }
        encoder.copy_buffer_to_buffer(&answer_buffer, 0, &read_buffer, 0, size);
        self.queue.submit([encoder.finish()]);
        read_buffer.slice(..).map_async(wgpu::MapMode::Read, |_| {});
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| ToolError::Kernel(e.to_string()))?;
        let mapped =
            read_buffer.slice(..).get_mapped_range().map_err(|e| ToolError::Kernel(e.to_string()))?;
        Ok(bytemuck::cast_slice(&mapped).to_vec())
    }

    /// Answers of `texel`, `filtered`, `trilinear` or `floats`, one for each query, in their order.
    ///
    /// # Errors
    /// [`ToolError::Kernel`] if there is no such entry point, or the device fails.
    pub fn answer(&self, loaded: &Loaded, entry: &str, queries: &[Query]) -> Result<Vec<Answer>> {
        let mut answers = Vec::with_capacity(queries.len());
        // A dispatch of at most 2^16 - 1 groups of 64; smaller ones keep watchdogs of real devices quiet.
        for chunk in queries.chunks(1 << 18) {
            answers.extend(self.run(
                loaded,
                entry,
                chunk,
                chunk.len(),
                [(chunk.len() as u32).div_ceil(64), 1],
            )?);
        }
        Ok(answers)
    }

    /// A whole image of `size` texels, row by row, for the material and directions of a query.
    ///
    /// # Errors
    /// [`ToolError::Kernel`] if the device fails.
    pub fn image(&self, loaded: &Loaded, query: Query, size: [u32; 2]) -> Result<Vec<Answer>> {
        self.run(loaded, "image", &[query], (size[0] * size[1]) as usize, size.map(|s| s.div_ceil(8)))
    }
}

/// A query of an entry point: any position, directions over the hemisphere and a little beyond.
pub fn random_query(random: &mut Random, entry: &str, material: u32) -> Query {
    let u = random.word();
    let v = random.word();
    let level_q16 = random.word() >> 12;
    let mut direction = || match entry {
        "texel" => [random.word() >> 20, 0, 0],
        "floats" => {
            let z = random.range(-100, 1000) as f32 / 1000.0;
            let azimuth = random.range(0, 100_000) as f32 / 100_000.0 * std::f32::consts::TAU;
            let r = (1.0 - z * z).max(0.0).sqrt();
            [r * azimuth.cos(), r * azimuth.sin(), z].map(f32::to_bits)
        }
        _ => [random.range(-262_400, 262_400), random.range(-262_400, 262_400), random.range(-9, 32_800)]
            .map(|c| c as u32),
    };
    let (light, view) = (direction(), direction());
    let (u, v) = match entry {
        "texel" => (u >> 22, v >> 22),
        "floats" => ((u as i32 as f32 / 1e9).to_bits(), (v as i32 as f32 / 1e9).to_bits()),
        _ => (u, v),
    };
    Query { material, u, v, level_q16, light, view }
}
