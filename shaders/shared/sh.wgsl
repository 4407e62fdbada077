// Real spherical harmonics, as server/scene/src/spherical/sh.rs defines them.

fn spherical_harmonic(k: u32, d: vec3f) -> f32 {
    let x = d.x * d.x;
    let y = d.y * d.y;
    let z = d.z * d.z;
    switch k {
        case 0u: { return 0.28209479177; }
        case 1u: { return 0.48860251190 * d.y; }
        case 2u: { return 0.48860251190 * d.z; }
        case 3u: { return 0.48860251190 * d.x; }
        case 4u: { return 1.09254843059 * d.x * d.y; }
        case 5u: { return 1.09254843059 * d.y * d.z; }
        case 6u: { return 0.31539156525 * (3.0 * z - 1.0); }
        case 7u: { return 1.09254843059 * d.x * d.z; }
        case 8u: { return 0.54627421530 * (x - y); }
        case 9u: { return 0.59004358993 * d.y * (3.0 * x - y); }
        case 10u: { return 2.89061144264 * d.x * d.y * d.z; }
        case 11u: { return 0.45704579946 * d.y * (5.0 * z - 1.0); }
        case 12u: { return 0.37317633259 * d.z * (5.0 * z - 3.0); }
        case 13u: { return 0.45704579946 * d.x * (5.0 * z - 1.0); }
        case 14u: { return 1.44530572132 * d.z * (x - y); }
        case 15u: { return 0.59004358993 * d.x * (x - 3.0 * y); }
        case 16u: { return 2.50334294180 * d.x * d.y * (x - y); }
        case 17u: { return 1.77013076978 * d.y * d.z * (3.0 * x - y); }
        case 18u: { return 0.94617469576 * d.x * d.y * (7.0 * z - 1.0); }
        case 19u: { return 0.66904654356 * d.y * d.z * (7.0 * z - 3.0); }
        case 20u: { return 0.10578554692 * ((35.0 * z - 30.0) * z + 3.0); }
        case 21u: { return 0.66904654356 * d.x * d.z * (7.0 * z - 3.0); }
        case 22u: { return 0.47308734788 * (x - y) * (7.0 * z - 1.0); }
        case 23u: { return 1.77013076978 * d.x * d.z * (x - 3.0 * y); }
        case 24u: { return 0.62583573545 * (x * (x - 3.0 * y) - y * (3.0 * x - y)); }
        case 25u: { return 0.65638205684 * d.y * (5.0 * x * x - 10.0 * x * y + y * y); }
        case 26u: { return 8.30264925952 * d.x * d.y * d.z * (x - y); }
        case 27u: { return 0.48923829943 * d.y * (3.0 * x - y) * (9.0 * z - 1.0); }
        case 28u: { return 4.79353678497 * d.x * d.y * d.z * (3.0 * z - 1.0); }
        case 29u: { return 0.45294665119 * d.y * ((21.0 * z - 14.0) * z + 1.0); }
        case 30u: { return 0.11695032245 * d.z * ((63.0 * z - 70.0) * z + 15.0); }
        case 31u: { return 0.45294665119 * d.x * ((21.0 * z - 14.0) * z + 1.0); }
        case 32u: { return 2.39676839249 * d.z * (x - y) * (3.0 * z - 1.0); }
        case 33u: { return 0.48923829943 * d.x * (x - 3.0 * y) * (9.0 * z - 1.0); }
        case 34u: { return 2.07566231488 * d.z * (x * x - 6.0 * x * y + y * y); }
        case 35u: { return 0.65638205684 * d.x * (x * x - 10.0 * x * y + 5.0 * y * y); }
        default: { return 0.0; }
    }
}
