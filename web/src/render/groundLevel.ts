/** How far the ground is below the lowest point, in diagonals: what lies on it does not flicker. */
const CLEARANCE = 0.002;

/**
 * How high the ground is, in diagonals, along the model's y or z axis: below all frames that are known. Those that have not been decoded are known by their
 * cages, and the model's lowest point is taken to be as far above the cage's as in the frame that was seen.
 */
export class GroundLevel {
  private readonly lowest = { y: Infinity, z: Infinity };
  private soleAboveCage = 0;

  /** Takes note of a vertex of a cage, in diagonals. */
  include(y: number, z: number) {
    this.lowest.y = Math.min(this.lowest.y, y);
    this.lowest.z = Math.min(this.lowest.z, z);
  }

  /** Takes note of the lowest points of a frame and of its cage along the axis in use; gives the level below that frame. */
  see(model: number, cage: number): number {
    this.soleAboveCage = model - cage;
    return model - CLEARANCE;
  }

  /** The level below all cages. */
  below(axis: 'y' | 'z'): number {
    return this.lowest[axis] + this.soleAboveCage - CLEARANCE;
  }
}
