import { describe, expect, it } from 'vitest';
import { fragmentOf, parseFragment } from '../routes';
import { USUAL_LAYERS, viewFromText, viewText } from './viewState';

describe('view in a link', () => {
  it('is read as it was written', () => {
    const view = {
      frame: 17,
      camera: { target: [0.1, 0.2, -0.3], azimuth: 0.5, elevation: -0.25, distance: 2.5 },
      up: 'z',
      besideUp: 'y',
      follow: true,
      layers: { ...USUAL_LAYERS, cage: true, ground: false, colors: false },
      heat: 'motion',
    } as const;
    const read = viewFromText(viewText(view));
    expect(read).toMatchObject({
      frame: 17,
      up: 'z',
      besideUp: 'y',
      follow: true,
      layers: view.layers,
      heat: 'motion',
    });
    expect(read.camera!.distance).toBe(2.5);
    expect(read.camera!.azimuth).toBeCloseTo(0.5, 2);
  });

  it('shows materials unless it says otherwise, so that links from before there were any do', () => {
    expect(viewFromText('show=mg').layers).toMatchObject({ model: true, colors: false, materials: true });
    const off = { ...USUAL_LAYERS, materials: false };
    expect(viewFromText('show=mgkx').layers).toEqual(off);
    expect(viewText({ ...viewFromText(''), layers: off })).toBe('show=mgkx');
  });

  it('says nothing where everything is as usual', () => {
    const usual = {
      frame: null,
      camera: null,
      up: null,
      besideUp: null,
      follow: null,
      layers: USUAL_LAYERS,
      heat: 'none',
    } as const;
    expect(viewText(usual)).toBe('');
  });

  it('passes over what is wrong', () => {
    expect(viewFromText('frame=-3&camera=1,2&up=q&heat=wave')).toEqual({
      frame: null,
      camera: null,
      up: null,
      besideUp: null,
      follow: null,
      layers: USUAL_LAYERS,
      heat: 'none',
    });
    expect(viewFromText('frame=1e99').frame).toBeNull();
  });
});

describe('routes', () => {
  it.each(['#/', '#/file', '#/upload', '#/session/a%2Fb?frame=3'])('%s is read as it is written', (fragment) => {
    const { route, view } = parseFragment(fragment);
    expect(fragmentOf(route, view)).toBe(fragment);
  });

  it('takes ids as they are, and anything unknown for the list', () => {
    expect(parseFragment('#/session/a%2Fb').route).toEqual({ page: 'session', id: 'a/b' });
    expect(parseFragment('#/session/%E0%A4%A').route).toEqual({ page: 'session', id: '%E0%A4%A' });
    expect(parseFragment('#/nothing/of/this').route).toEqual({ page: 'sessions' });
    expect(parseFragment('').route).toEqual({ page: 'sessions' });
  });
});
