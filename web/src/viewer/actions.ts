import { orbited, zoomed } from '../render/camera';
import type { Layers } from '../render/drawn';
import type { CagerViewer } from './cagerViewer';
import { frameText } from './frameNumbers';
import type { Heat } from './heatMap';
import type { Player } from './player';
import { save } from '../save';
import type { Action } from './shortcuts';
import { sentence } from '../text';
import { ranged, REPEATS, sought, spedUp, started, stepped, worstFrame, type Transport } from './transport';

const [TURN, ZOOM] = [Math.PI / 12, 1.15];

export function perform(action: Action, viewer: CagerViewer) {
  const { player } = viewer;
  if (!player) return;
  const { transport, controls } = player;
  const turn = (azimuth: number, elevation: number) => controls.go(orbited(controls.destination, azimuth, elevation));
  const zoom = (factor: number) => controls.go(zoomed(controls.destination, factor));
  const toggle = (layer: keyof Layers) => (player.layers = { ...player.layers, [layer]: !player.layers[layer] });
  const actions: Readonly<Record<Action, () => void>> = {
    play: () => (player.transport = transport.playing ? { ...transport, playing: false } : started(transport)),
    previous: () => (player.transport = stepped(transport, -1)),
    next: () => (player.transport = stepped(transport, 1)),
    back: () => (player.transport = stepped(transport, -10)),
    forth: () => (player.transport = stepped(transport, 10)),
    first: () => (player.transport = sought(transport, 0)),
    last: () => (player.transport = sought(transport, transport.frames)),
    slower: () => (player.transport = spedUp(transport, -1)),
    faster: () => (player.transport = spedUp(transport, 1)),
    loop: () => (player.transport = { ...transport, repeat: nextRepeat(transport), direction: 1 }),
    in: () => (player.transport = ranged(transport, 'in')),
    out: () => (player.transport = ranged(transport, 'out')),
    smooth: () => (player.transport = { ...transport, smooth: !transport.smooth }),
    worst: () => goToWorst(player),
    frame: () => player.frameAll(),
    home: () => player.goHome(),
    follow: () => player.chooseFollowing(!player.isFollowing),
    turnLeft: () => turn(-TURN, 0),
    turnRight: () => turn(TURN, 0),
    turnUp: () => turn(0, TURN),
    turnDown: () => turn(0, -TURN),
    zoomIn: () => zoom(1 / ZOOM),
    zoomOut: () => zoom(ZOOM),
    up: () => (viewer.up = viewer.up === 'y' ? 'z' : 'y'),
    model: () => toggle('model'),
    wireframe: () => toggle('wireframe'),
    points: () => toggle('points'),
    cage: () => toggle('cage'),
    handles: () => toggle('handles'),
    ground: () => toggle('ground'),
    colors: () => toggle('colors'),
    materials: () => toggle('materials'),
    parts: () => viewer.togglePanel('parts'),
    heat: () => player.setHeat(nextHeat(player)),
    compare: () => compare(player),
    picture: () => void savePicture(viewer, player),
    turntable: () => void toggleRecording(viewer, player),
    fullscreen: () => void toggleFullscreen(viewer),
    figures: () => viewer.togglePanel('figures'),
    export: () => viewer.togglePanel('export'),
    views: () => viewer.togglePanel('views'),
    link: () => void copyLink(viewer),
    edit: () => void viewer.toggleEditing(),
    poses: () => void viewer.togglePoses(),
    beside: () => viewer.toggleBeside(),
    help: () => viewer.openHelp(),
  };
  actions[action]();
}

function goToWorst(player: Player) {
  const { tracking, errors } = player.capture;
  const worst = worstFrame(tracking?.scores ?? errors.linf);
  if (worst !== null) player.transport = { ...sought(player.transport, worst), playing: false };
}

function nextRepeat({ repeat }: Transport) {
  return REPEATS[(REPEATS.indexOf(repeat) + 1) % REPEATS.length];
}

function nextHeat({ heatMap: { kind, kinds } }: Player): Heat {
  return kinds[(kinds.indexOf(kind) + 1) % kinds.length];
}

/** Shows the next side of a comparison; without an original, where one could come from. */
function compare(player: Player) {
  const { comparison } = player;
  const { sides, side } = comparison;
  if (comparison.isOpen) comparison.side = sides[(sides.indexOf(side) + 1) % sides.length];
  else player.setHeat('error');
}

async function savePicture(viewer: CagerViewer, player: Player) {
  try {
    save(await pictureOf(viewer, player), `${stem(viewer)}-${frameText(player.transport.numbers, viewer.frame)}.png`);
  } catch (error) {
    viewer.report(sentence(error));
  }
}

/** The picture, with that of the capture beside where there is one. */
async function pictureOf(viewer: CagerViewer, player: Player): Promise<Blob> {
  const second = viewer.pair.player;
  if (!second) return player.picture();
  const pictures = await Promise.all([player, second].map(async (each) => createImageBitmap(await each.picture())));
  const [a, b] = pictures;
  const isWide = viewer.getAttribute('pictures') === 'columns';
  // Beside panels they are not equally wide.
  const canvas = isWide
    ? new OffscreenCanvas(a.width + b.width, Math.max(a.height, b.height))
    : new OffscreenCanvas(Math.max(a.width, b.width), a.height + b.height);
  const context = canvas.getContext('2d')!;
  context.drawImage(a, 0, 0);
  context.drawImage(b, isWide ? a.width : 0, isWide ? 0 : a.height);
  return canvas.convertToBlob({ type: 'image/png' });
}

/** Begins to record a turn, or stops recording without saving anything. */
async function toggleRecording(viewer: CagerViewer, player: Player) {
  if (viewer.recording) {
    viewer.recording.abort();
    return;
  }
  const recording = new AbortController();
  viewer.recording = recording;
  try {
    const showProgress = (fraction: number) => {
      player.progress = { doing: 'Recording turntable', fraction };
      viewer.requestUpdate();
    };
    // What writes videos is loaded when it is wanted.
    const { recordTurntable } = await import('./recording');
    const { video, ending } = await recordTurntable(player, recording.signal, showProgress);
    save(video, `${stem(viewer)}.${ending}`);
  } catch (error) {
    if (!recording.signal.aborted) viewer.report(sentence(error));
  } finally {
    player.progress = null;
    viewer.recording = null;
  }
}

/** Copies the address of the page, which follows the view. */
async function copyLink(viewer: CagerViewer) {
  if (!viewer.linkable) return;
  try {
    viewer.tellView();
    await navigator.clipboard.writeText(location.href);
    viewer.say('Link copied');
  } catch {
    viewer.report('The link could not be copied. Copy it from the address bar.');
  }
}

async function toggleFullscreen(viewer: CagerViewer) {
  try {
    await (document.fullscreenElement ? document.exitFullscreen() : viewer.requestFullscreen());
  } catch {
    viewer.report('Full screen is not available here.');
  }
}

/** What files that are saved are named after. */
export function stem(viewer: CagerViewer): string {
  return viewer.heading.replace(/\.cager$/i, '');
}
