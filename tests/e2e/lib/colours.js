/** Colours of the two labels of `letterL` as the service chooses them, in any light. */

export const isGreen = (r, g, b) => g > 50 && g > 1.25 * b && g > 1.15 * r;
export const isViolet = (r, g, b) => b > 50 && b > 1.25 * g && r > g;
