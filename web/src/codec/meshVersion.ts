/**
 * How a mesh was coded. Of the first version, codec 3 of a container, the numbers of vertices come within the faces, and positions are predicted by parallelograms
 * alone; of the second, codec 4, numbers come after the faces, and what predicts positions is weighted.
 */
export type MeshVersion = 'first' | 'second';
