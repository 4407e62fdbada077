//! The device: chosen, opened, watched.

use std::sync::{Arc, Mutex};

use proto::rest::DeviceInfo;

use crate::device_clock::{DeviceClock, Turn};
use crate::error::RenderError;

/// Allocations fail cleanly beyond this share of the memory that the driver says is there, percent:
/// drivers, and systems that lend the software device their memory, fail worse when it is gone.
const MEMORY_SHARE_PERCENT: u8 = 90;

/// Which adapters may be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdapterPolicy {
    /// A hardware GPU if there is one, else the software device.
    Any,
    /// Refuse software devices.
    HardwareOnly,
}

/// An open device. Shared by everything that uses the GPU.
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    info: DeviceInfo,
    limits: wgpu::Limits,
    /// Optional abilities, probed once.
    pub(crate) abilities: Abilities,
    /// Where the device tells times.
    clock: Option<DeviceClock>,
    /// First error the driver reported outside an error scope; taken by [`Gpu::take_error`].
    error: Arc<Mutex<Option<RenderError>>>,
}

/// What the device can do beyond core WebGPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Abilities {
    /// `R32Float` textures can be filtered.
    pub filter_f32: bool,
    /// `R16Unorm` textures exist and can be filtered.
    pub filter_unorm16: bool,
}

impl Gpu {
    /// Opens the best adapter the policy allows: discrete before integrated before software.
    ///
    /// # Errors
    /// No adapter, or the driver refuses.
    pub fn open(policy: AdapterPolicy) -> Result<Arc<Self>, RenderError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        descriptor.memory_budget_thresholds.for_resource_creation = Some(MEMORY_SHARE_PERCENT);
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::VirtualGpu => 1,
            wgpu::DeviceType::IntegratedGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        });
        let adapter = adapters.into_iter().next().ok_or_else(|| {
            RenderError::NoAdapter(
                "install the GPU's driver, or mesa-vulkan-drivers and libvulkan1 for the software device"
                    .into(),
            )
        })?;
        let adapter_info = adapter.get_info();
        let software = adapter_info.device_type == wgpu::DeviceType::Cpu;
        if software && policy == AdapterPolicy::HardwareOnly {
            return Err(RenderError::NoAdapter(format!(
                "only the software device `{}` is there, and it was not asked for",
                adapter_info.name
            )));
        }
        Self::open_adapter(&adapter, adapter_info, software)
    }

    fn open_adapter(
        adapter: &wgpu::Adapter,
        adapter_info: wgpu::AdapterInfo,
        software: bool,
    ) -> Result<Arc<Self>, RenderError> {
        let wanted = wgpu::Features::FLOAT32_FILTERABLE
            | wgpu::Features::TEXTURE_FORMAT_16BIT_NORM
            | DeviceClock::FEATURES;
        let features = adapter.features() & wanted;
        let limits = adapter.limits();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("tyndall"),
            required_features: features,
            required_limits: limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        }))
        .map_err(|error| RenderError::Device {
            name: adapter_info.name.clone(),
            reason: error.to_string(),
        })?;

        let filterable = |format| {
            let flags = adapter.get_texture_format_features(format).flags;
            flags.contains(wgpu::TextureFormatFeatureFlags::FILTERABLE)
        };
        let abilities = Abilities {
            filter_f32: features.contains(wgpu::Features::FLOAT32_FILTERABLE),
            filter_unorm16: features.contains(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM)
                && filterable(wgpu::TextureFormat::R16Unorm),
        };
        let error = Arc::new(Mutex::new(None));
        watch(&device, &error);
        let driver = format!("{} {}", adapter_info.driver, adapter_info.driver_info);
        let info = DeviceInfo { name: adapter_info.name, driver: driver.trim().to_owned(), software };
        tracing::info!(device = info.name, driver = info.driver, software, "GPU opened");
        let clock = DeviceClock::of(&device, &queue);
        Ok(Arc::new(Self { device, queue, info, limits, abilities, clock, error }))
    }

    /// What renders.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Largest storage buffer binding, bytes.
    pub fn max_binding_bytes(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size
    }

    /// Longest edge of a 2D texture, texels.
    pub(crate) fn max_texture_edge_2d(&self) -> u32 {
        self.limits.max_texture_dimension_2d
    }

    /// Longest edge of a 3D texture, texels.
    pub(crate) fn max_texture_edge_3d(&self) -> u32 {
        self.limits.max_texture_dimension_3d
    }

    /// Limits and abilities that matter here, as name and value, for `tyndall doctor`.
    pub fn properties(&self) -> Vec<(&'static str, String)> {
        let mebibytes = |bytes: u64| format!("{} MiB", bytes >> 20);
        let yes_no = |b: bool| if b { "yes" } else { "no" }.to_owned();
        vec![
            ("storage buffer binding", mebibytes(self.limits.max_storage_buffer_binding_size)),
            ("largest buffer", mebibytes(self.limits.max_buffer_size)),
            ("3D texture edge", format!("{} voxels", self.limits.max_texture_dimension_3d)),
            ("workgroup", format!("{} invocations", self.limits.max_compute_invocations_per_workgroup)),
            ("filters 32-bit float textures", yes_no(self.abilities.filter_f32)),
            ("filters 16-bit integer textures", yes_no(self.abilities.filter_unorm16)),
            ("times of passes", if self.clock.is_some() { "by its own clock" } else { "by the wall" }.into()),
        ]
    }

    /// Waits until everything submitted is done.
    pub(crate) fn wait(&self) -> Result<(), RenderError> {
        let polled = self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None });
        self.take_error()?;
        polled.map(|_| ()).map_err(|error| RenderError::Gpu(error.to_string()))
    }

    /// Loses the device, as a driver may at any time: whatever it held is gone. For tests of what
    /// follows.
    pub fn lose(&self) {
        self.device.destroy();
        let lost = RenderError::DeviceLost("given up on request".into());
        let mut slot = self.error.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        slot.get_or_insert(lost);
    }

    /// The first error reported since the last call.
    pub(crate) fn take_error(&self) -> Result<(), RenderError> {
        let mut slot = self.error.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        slot.take().map_or(Ok(()), Err)
    }

    /// Runs `allocate`; an out-of-memory error becomes [`RenderError::OutOfMemory`].
    pub(crate) fn allocating<T>(
        &self,
        what: &str,
        bytes: u64,
        allocate: impl FnOnce() -> T,
    ) -> Result<T, RenderError> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let value = allocate();
        match pollster::block_on(scope.pop()) {
            None => Ok(value),
            Some(_) => Err(RenderError::OutOfMemory { what: what.to_owned(), bytes }),
        }
    }

    /// The pipeline of a module's entry point, which is named as the pass is; without a layout that of
    /// what it uses.
    pub(crate) fn compute_pipeline(
        &self,
        pass: &str,
        layout: Option<&wgpu::PipelineLayout>,
        module: &wgpu::ShaderModule,
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(pass),
            layout,
            module,
            entry_point: Some(pass),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                ..wgpu::PipelineCompilationOptions::default()
            },
            cache: None,
        })
    }

    /// Submits one dispatch of a compute pipeline: workgroups along x and y.
    pub(crate) fn dispatch(
        &self,
        pipeline: &wgpu::ComputePipeline,
        bind_group: &wgpu::BindGroup,
        [columns, rows]: [u32; 2],
    ) {
        self.dispatch_3d(pipeline, bind_group, [columns, rows, 1]);
    }

    /// Submits one dispatch of a compute pipeline.
    pub(crate) fn dispatch_3d(
        &self,
        pipeline: &wgpu::ComputePipeline,
        bind_group: &wgpu::BindGroup,
        [columns, rows, layers]: [u32; 3],
    ) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut clock = self.clock.as_ref().map(DeviceClock::turn);
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: clock.as_mut().and_then(Turn::stamps),
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &[]);
            pass.dispatch_workgroups(columns, rows, layers);
        }
        self.queue.submit([encoder.finish()]);
    }

    /// A texture with contents.
    pub(crate) fn filled_texture(
        &self,
        label: &str,
        size: wgpu::Extent3d,
        dimension: wgpu::TextureDimension,
        format: wgpu::TextureFormat,
        bytes: &[u8],
    ) -> Result<wgpu::TextureView, RenderError> {
        let descriptor = wgpu::TextureDescriptor {
            label: Some(label),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        };
        let create = || self.device.create_texture(&descriptor);
        let texture = self.allocating(label, bytes.len() as u64, create)?;
        let rows = size.height * size.depth_or_array_layers;
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes.len() as u32 / rows),
            rows_per_image: Some(size.height),
        };
        self.queue.write_texture(texture.as_image_copy(), bytes, layout, size);
        Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
    }

    /// A storage or uniform buffer.
    pub(crate) fn buffer(
        &self,
        label: &str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, RenderError> {
        let descriptor = wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.max(16),
            usage,
            mapped_at_creation: false,
        };
        self.allocating(label, bytes, || self.device.create_buffer(&descriptor))
    }

    /// Time of the dispatches since the last call that were read back from, by the device's own clock,
    /// milliseconds; `None` where it has none.
    pub(crate) fn take_device_millis(&self) -> Option<f64> {
        self.clock.as_ref().and_then(DeviceClock::take_millis)
    }

    /// Copies a buffer to the host. Waits for everything submitted before.
    pub(crate) fn read_buffer(&self, source: &wgpu::Buffer, bytes: u64) -> Result<Vec<u8>, RenderError> {
        self.read_part(source, 0, bytes)
    }

    /// Copies a part of a buffer to the host: `bytes` from `from` on, multiples of 4. Waits for everything
    /// submitted before.
    pub(crate) fn read_part(
        &self,
        source: &wgpu::Buffer,
        from: u64,
        bytes: u64,
    ) -> Result<Vec<u8>, RenderError> {
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let mut turn = self.clock.as_ref().map(DeviceClock::turn);
        let times_bytes = turn.as_ref().map_or(0, Turn::pending_bytes);
        let times_at = bytes.next_multiple_of(8);
        let whole = times_at + times_bytes;
        let staging = self.buffer("read back", whole, usage)?;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(source, from, &staging, 0, bytes);
        if let Some(turn) = &mut turn {
            turn.copy(&mut encoder, &staging, times_at);
        }
        self.queue.submit([encoder.finish()]);
        drop(turn);
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, 0..whole, move |result| {
            let _ = sender.send(result);
        });
        self.wait()?;
        let failed = |reason: String| RenderError::Gpu(format!("reading back failed: {reason}"));
        receiver.recv().map_err(|e| failed(e.to_string()))?.map_err(|e| failed(e.to_string()))?;
        let view = staging.get_mapped_range(0..whole).map_err(|e| failed(e.to_string()))?;
        if let Some(clock) = &self.clock {
            clock.take_in(&view[times_at as usize..]);
        }
        Ok(view[..bytes as usize].to_vec())
    }
}

/// Binds a whole buffer.
pub(crate) fn buffer_entry(binding: u32, buffer: &wgpu::Buffer) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
}

/// Binds a texture.
pub(crate) fn texture_entry(binding: u32, view: &wgpu::TextureView) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::TextureView(view) }
}

/// Keeps the first error the driver reports outside a scope, and a lost device.
fn watch(device: &wgpu::Device, slot: &Arc<Mutex<Option<RenderError>>>) {
    let keep = |slot: &Mutex<Option<RenderError>>, error: RenderError| {
        tracing::error!(%error, "GPU");
        let mut slot = slot.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        slot.get_or_insert(error);
    };
    let uncaptured = slot.clone();
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        keep(&uncaptured, RenderError::Gpu(error.to_string()));
    }));
    let lost = slot.clone();
    device.set_device_lost_callback(move |reason, message| {
        if reason != wgpu::DeviceLostReason::Destroyed {
            keep(&lost, RenderError::DeviceLost(message));
        }
    });
}
