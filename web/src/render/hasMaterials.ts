import type { ModelSurface } from '../capture';

export function hasMaterials({ mesh }: ModelSurface): boolean {
  return mesh.ranges.some(({ material }) => material > 0);
}
