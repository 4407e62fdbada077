// What a scene uses: the code of all else is left out of its pipeline.

override BLINN_PHONG: bool = true;
override ASHIKHMIN_SHIRLEY: bool = true;
override ABC: bool = true;
override HENYEY_GREENSTEIN: bool = true;
override SCHLICK: bool = true;
// Lights other than directional ones.
override LIGHTS_WITH_A_PLACE: bool = true;
// Gradients: some material has a surface, and there is light.
override SURFACES: bool = true;
override EMISSION: bool = true;
