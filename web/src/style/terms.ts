import { html } from 'lit';

/** The product and the words that its pages use. */
export const terms = html`<p>
    CageR stores an animated mesh as the motion of a cage and plays it back by moving the mesh with the cage.
  </p>
  <dl class="terms">
    <dt>Cage</dt>
    <dd>A coarse mesh around the model. Moving its vertices deforms the model inside.</dd>
    <dt>Diagonal</dt>
    <dd>The diagonal of the box around the rest pose. Errors are given in percent of it.</dd>
    <dt>L2</dt>
    <dd>The root mean square of the distances between the original points and the decoded ones, in one frame.</dd>
    <dt>L∞</dt>
    <dd>The largest of these distances: the worst point.</dd>
  </dl>`;
