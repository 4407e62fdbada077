/**
 * JSON merge patches (RFC 7396) as values: apply, compose, derive.
 *
 * A patch replaces arrays whole, merges objects key by key, and `null` removes a key. Everything
 * here is pure and shares unchanged parts, so that `===` tells what changed.
 */

export type Patch = Record<string, unknown>;

function isObject(value: unknown): value is Patch {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** The document after `patch`; parts the patch does not name keep their identity. */
export function applyPatch<T>(target: T, patch: Patch): T {
  const result: Patch = isObject(target) ? { ...target } : {};
  for (const [key, value] of Object.entries(patch)) {
    if (value === null || value === undefined) Reflect.deleteProperty(result, key);
    else result[key] = isObject(value) ? applyPatch(result[key], value) : value;
  }
  return result as T;
}

/**
 * One patch that does what `first` and then `second` do; `null` where no single merge patch can
 * (an object that replaces a leaf or a removal).
 */
export function composePatches(first: Patch, second: Patch): Patch | null {
  const result: Patch = { ...first };
  for (const [key, value] of Object.entries(second)) {
    const before = first[key];
    if (isObject(value) && key in first) {
      if (!isObject(before)) return null;
      const merged = composePatches(before, value);
      if (merged === null) return null;
      result[key] = merged;
    } else {
      result[key] = value;
    }
  }
  return result;
}

/** The smallest patch that turns `from` into `to`; empty if they are equal. */
export function diffPatch(from: object, to: object): Patch {
  const before = from as Patch;
  const after = to as Patch;
  const patch: Patch = {};
  for (const [key, value] of Object.entries(after)) {
    const old = before[key];
    if (value === undefined || deepEqual(old, value)) continue;
    patch[key] = isObject(old) && isObject(value) ? diffPatch(old, value) : value;
  }
  for (const [key, value] of Object.entries(before)) {
    if (value !== undefined && after[key] === undefined) patch[key] = null;
  }
  return patch;
}

export const isEmptyPatch = (patch: Patch): boolean => Object.keys(patch).length === 0;

/** Whether two JSON values are equal; absent and `undefined` keys are the same. */
export function deepEqual(a: unknown, b: unknown): boolean {
  if (Object.is(a, b)) return true;
  if (Array.isArray(a) && Array.isArray(b)) {
    return a.length === b.length && a.every((item, index) => deepEqual(item, b[index]));
  }
  if (!isObject(a) || !isObject(b)) return false;
  const keys = new Set([...Object.keys(a), ...Object.keys(b)]);
  return [...keys].every((key) => deepEqual(a[key], b[key]));
}

/** `next`, with every part that equals its counterpart in `previous` replaced by that part. */
export function shareStructure<T>(previous: unknown, next: T): T {
  if (deepEqual(previous, next)) return previous as T;
  if (Array.isArray(next) && Array.isArray(previous)) {
    return next.map((item, index) => shareStructure<unknown>(previous[index], item)) as T;
  }
  if (isObject(next) && isObject(previous)) {
    const entries = Object.entries(next).map(([key, value]) => [key, shareStructure(previous[key], value)]);
    return Object.fromEntries(entries) as T;
  }
  return next;
}
