/** What a walk over a mesh calls the vertices that it meets. */

import { CodedDataError } from './error';
import { CountedSet } from './fenwick';
import { IntegerModels, SIZE_CLASSES, sizeClass } from './integers';
import type { RangeDecoder } from './rangeDecoder';

export interface VertexNames {
  /** A vertex that is met for the first time, near another; null where no more are left. */
  first(decoder: RangeDecoder, near: number): number | null;
  /** A vertex that was met, but that nothing leads to; damaged bytes may name one that does not exist. */
  again(decoder: RangeDecoder): number;
}

/** By their turn: the numbers of the mesh follow after the faces. */
export class Turns implements VertexNames {
  private met = 0;

  constructor(private readonly points: number) {}

  first(): number | null {
    return this.met < this.points ? this.met++ : null;
  }

  again(decoder: RangeDecoder): number {
    const turn = decoder.bits(32 - Math.clz32(this.met));
    if (turn >= this.met) {
      throw new CodedDataError('a face names a vertex that was not met');
    }
    return turn;
  }
}

/** By the numbers of the mesh, read where they are met, by how many others that are not met yet lie between one and one that was: of the first version. */
export class Numbers implements VertexNames {
  private readonly models = new IntegerModels(SIZE_CLASSES);
  private readonly unmet: CountedSet;
  private before = 0;

  constructor(points: number) {
    this.unmet = CountedSet.all(points);
  }

  first(decoder: RangeDecoder, near: number): number | null {
    const expected = this.unmet.before(near);
    const context = sizeClass(Math.min(this.before, 1 << 16) * 2);
    const difference = this.models.signed(decoder, context);
    this.before = (this.before + Math.min(Math.abs(difference), 1 << 20)) >> 1;
    const vertex = this.unmet.find(expected + difference);
    if (vertex !== null) {
      this.unmet.remove(vertex);
    }
    return vertex;
  }

  again(decoder: RangeDecoder): number {
    return decoder.bits(32);
  }
}
