/** Colours of the two labels of `letterL` as the service chooses them, in any light. */

export const isTeal = (r, g, b) => g > 50 && g > 1.4 * r && b > 1.15 * r && g > 0.95 * b;
export const isMagenta = (r, g, b) => b > 50 && b > 1.25 * g && r > g;
