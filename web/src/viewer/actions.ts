import { orbited, zoomed } from '../render/camera';
import type { Layers } from '../render/stage';
import type { CagerViewer } from './cagerViewer';
import type { Heat } from './heatMap';
import type { Player } from './player';
import { recordTurntable, save } from './recording';
import type { Action } from './shortcuts';
import { sought, spedUp, started, stepped, worstFrame } from './transport';

/** Angle and factor of one press of a key. */
const [TURN, ZOOM] = [Math.PI / 12, 1.15];

/** Does what a key or a button asks for. */
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
    loop: () => (player.transport = { ...transport, loop: !transport.loop }),
    smooth: () => (player.transport = { ...transport, smooth: !transport.smooth }),
    worst: () => goToWorst(player),
    frame: () => player.frameAll(),
    home: () => player.goHome(),
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
    heat: () => player.setHeat(nextHeat(player)),
    compare: () => compare(player),
    picture: () => void savePicture(viewer, player),
    turntable: () => void toggleRecording(viewer, player),
    fullscreen: () => void toggleFullscreen(viewer),
    figures: () => (viewer.figures = !viewer.figures),
    edit: () => void viewer.editing.toggle(),
    help: () => viewer.openHelp(),
  };
  actions[action]();
}

function goToWorst(player: Player) {
  const worst = worstFrame(player.capture.errors.linf);
  if (worst !== null) player.transport = { ...sought(player.transport, worst), playing: false };
}

function nextHeat({ heatMap: { kind, kinds } }: Player): Heat {
  return kinds[(kinds.indexOf(kind) + 1) % kinds.length];
}

/** Shows the next side of a comparison; without an original, where one could come from. */
function compare(player: Player) {
  const { comparison } = player;
  const next = { decoded: 'both', both: 'original', original: 'decoded' } as const;
  if (comparison.original) comparison.side = next[comparison.side];
  else player.setHeat('error');
}

async function savePicture(viewer: CagerViewer, player: Player) {
  try {
    save(await player.picture(), `${stem(viewer)}-${viewer.frame}.png`);
  } catch (error) {
    viewer.report(error instanceof Error ? error.message : String(error));
  }
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
      player.progress = { doing: 'Recording one turn', fraction };
      viewer.requestUpdate();
    };
    const { video, ending } = await recordTurntable(player, recording.signal, showProgress);
    save(video, `${stem(viewer)}.${ending}`);
  } catch (error) {
    if (!recording.signal.aborted) viewer.report(error instanceof Error ? error.message : String(error));
  } finally {
    player.progress = null;
    viewer.recording = null;
  }
}

async function toggleFullscreen(viewer: CagerViewer) {
  try {
    await (document.fullscreenElement ? document.exitFullscreen() : viewer.requestFullscreen());
  } catch {
    viewer.report('This browser does not allow full screen here.');
  }
}

/** What files that are saved are named after. */
export function stem(viewer: CagerViewer): string {
  return viewer.heading.replace(/\.cager$/i, '').replace(/[^\w.-]+/g, '-');
}
