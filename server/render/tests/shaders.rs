//! Every WGSL module is valid, needs no optional feature, and lays its structs out as the host does.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use render::{shaders, uniforms};

fn parsed() -> Vec<(&'static str, naga::Module)> {
    shaders::ALL
        .iter()
        .map(|(name, source)| {
            let module = naga::front::wgsl::parse_str(source)
                .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
            (*name, module)
        })
        .collect()
}

#[test]
fn modules_are_valid_without_optional_capabilities() {
    for (name, module) in parsed() {
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|error| panic!("{name}: {error:?}"));
    }
}

#[test]
fn core_limit_of_storage_buffers_holds() {
    for (name, module) in parsed() {
        let count = module
            .global_variables
            .iter()
            .filter(|(_, variable)| matches!(variable.space, naga::AddressSpace::Storage { .. }))
            .count();
        assert!(count <= 8, "{name} binds {count} storage buffers; core WebGPU allows 8");
    }
}

#[test]
fn struct_layouts_agree_with_the_host() {
    let modules = parsed();
    for (name, size, fields) in uniforms::layouts() {
        let mut found = false;
        for (_, module) in &modules {
            for (_, ty) in module.types.iter() {
                let naga::TypeInner::Struct { members, span } = &ty.inner else { continue };
                if ty.name.as_deref() != Some(name) {
                    continue;
                }
                found = true;
                assert_eq!(*span as usize, size, "size of {name}");
                let shader: Vec<(&str, usize)> = members
                    .iter()
                    .map(|member| (member.name.as_deref().unwrap_or(""), member.offset as usize))
                    .collect();
                assert_eq!(shader, fields, "fields of {name}");
            }
        }
        assert!(found, "{name} is in no shader");
    }
}

/// Array sizes are stated on both sides; this proves them equal.
#[test]
fn array_capacities_agree_with_the_host() {
    use proto::scene_file::limits;
    for (text, capacity) in [
        (format!("const MAX_MATERIALS = {};", limits::MAX_MATERIALS + 1), "materials"),
        ("const TF_CELLS = 1024.0;".to_owned(), "transfer function cells"),
        (format!("const MAX_LIGHTS = {};", limits::MAX_LIGHTS), "lights"),
        (format!("planes: array<vec4f, {}>", limits::MAX_CLIP_PLANES), "clip planes"),
    ] {
        assert!(shaders::RAY_CAST.contains(&text), "{capacity}: the shader does not say `{text}`");
    }
}
