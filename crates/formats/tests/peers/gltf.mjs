// What the validator of Khronos says of a .glb file, then where three.js puts its points, a line for each time in seconds.
// node gltf.mjs FOLDER_OF_PACKAGES FILE.glb SECONDS...

import { readFileSync } from 'node:fs'
import { createRequire } from 'node:module'
import { resolve } from 'node:path'
import { pathToFileURL } from 'node:url'

const [folder, file, ...times] = process.argv.slice(2)
const bytes = new Uint8Array(readFileSync(file))

const { validateBytes } = createRequire(resolve(folder, 'x.js'))('gltf-validator')
const { issues } = await validateBytes(bytes)
console.log(`${issues.numErrors} errors, ${issues.numWarnings} warnings`)
for (const issue of issues.messages.filter(({ severity }) => severity < 2)) {
  console.error(issue.pointer, issue.code, issue.message)
}

const from = path => import(pathToFileURL(resolve(folder, 'node_modules/three', path)))
const { AnimationMixer, LoopOnce, Vector3 } = await from('build/three.module.js')
const { GLTFLoader } = await from('examples/jsm/loaders/GLTFLoader.js')
const { scene, animations } = await new GLTFLoader().parseAsync(bytes.buffer, '')
const mixer = new AnimationMixer(scene)
for (const clip of animations) {
  const action = mixer.clipAction(clip)
  action.setLoop(LoopOnce)
  action.clampWhenFinished = true
  action.play()
}
const point = new Vector3()
for (const time of times) {
  mixer.setTime(Number(time))
  scene.updateMatrixWorld(true)
  const numbers = []
  scene.traverse(object => {
    const count = object.geometry?.attributes.position.count ?? 0
    for (let k = 0; k < count; k++) {
      if (object.isMesh) object.getVertexPosition(k, point)
      else point.fromBufferAttribute(object.geometry.attributes.position, k)
      numbers.push(...point.applyMatrix4(object.matrixWorld).toArray())
    }
  })
  console.log(numbers.join(' '))
}
