// Compiles a job of a Flamenco job type: node compile.js JOB_TYPE.js SETTINGS.json, tasks as JSON on standard output.
//
// A stand-in for Flamenco's job compiler, which runs such scripts in an interpreter of its own: the same names and shapes, of
// frameChunker chunks of one frame alone, and none of the Manager's checks of submitted settings.

const fs = require("fs");
const vm = require("vm");

class Task {
    constructor(name, type) {
        if (!name.trim() || !type.trim()) throw new Error("author.Task(name, type): both are required");
        Object.assign(this, { name: name.trim(), type: type.trim(), commands: [] });
    }
    addCommand(command) { this.commands.push(command); }
}

function frameChunker(range, size) {
    if (size !== 1) throw new Error("frameChunker: the stand-in has chunks of one frame alone");
    const frames = new Set();
    for (const part of range.replaceAll("..", "-").split(",")) {
        const ends = part.split("-").map((end) => /^\s*\d+\s*$/.test(end) ? Number(end) : NaN);
        if (ends.length > 2 || ends.some(Number.isNaN)) throw new Error(`invalid range "${range}": ${part}`);
        for (let frame = ends[0]; frame <= ends[ends.length - 1]; frame++) frames.add(frame);
    }
    return [...frames].sort((a, b) => a - b).map(String);
}

const [, , script, settings] = process.argv;
const tasks = [];
const world = vm.createContext({
    author: { Task: (name, type) => new Task(name, type), Command: (name, parameters) => ({ name, parameters }) },
    path: { join: require("path").posix.join },
    print: () => {},
    frameChunker,
    job: { settings: JSON.parse(fs.readFileSync(settings, "utf8")), addTask: (task) => tasks.push(task) },
});
vm.runInContext(fs.readFileSync(script, "utf8"), world, { filename: script });

const known = { string: "string", float: "number", int32: "number", bool: "boolean" };
for (const { key, type, default: usual } of vm.runInContext("JOB_TYPE.settings", world)) {
    if (!known[type]) throw new Error(`${key}: has the unknown type ${type}`);
    if (usual !== undefined && typeof usual !== known[type]) throw new Error(`${key}: its default is no ${type}`);
}
try {
    vm.runInContext("compileJob(job)", world);
} catch (refusal) {
    console.error(refusal);
    process.exit(1);
}
console.log(JSON.stringify(tasks));
