/** What the browser makes of a colour that depends on the theme, for canvases, which know no custom properties. */
export function resolvedColor(root: ParentNode & Node, color: string): string {
  const probe = document.createElement('span');
  probe.style.color = color;
  root.appendChild(probe);
  const resolved = getComputedStyle(probe).color;
  probe.remove();
  return resolved;
}
