/** Small texts about failures. */

/** The member of the scene that a field path lies in. */
export const rootOf = (field: string): string => /^[a-z_]*/.exec(field)?.[0] ?? "";

export const wordsOf = (error: unknown): string => (error instanceof Error ? error.message : String(error));
