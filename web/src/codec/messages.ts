/** Messages between the page and the worker that decodes. */

import type { GroupDecoder } from './groupDecoder';

export type Method =
  'faces' | 'positions' | 'surface' | 'errors' | 'setModel' | 'addCoordinates' | 'cages' | 'residual';

export interface Call {
  readonly id: number;
  readonly method: Method;
  readonly args: unknown[];
}

export type Answer =
  | { readonly id: number; readonly result: unknown }
  | { readonly id: number; readonly failure: string; readonly damaged: boolean };

export type Arguments<M extends Method> = Parameters<GroupDecoder[M]>;
export type Result<M extends Method> = ReturnType<GroupDecoder[M]>;

/** Buffers of all typed arrays in a value, each once. */
export function transferables(value: unknown): ArrayBuffer[] {
  const found = new Set<ArrayBuffer>();
  const visit = (part: unknown): void => {
    if (ArrayBuffer.isView(part)) {
      if (part.buffer instanceof ArrayBuffer) found.add(part.buffer);
    } else if (typeof part === 'object' && part !== null) {
      Object.values(part).forEach(visit);
    }
  };
  visit(value);
  return [...found];
}
