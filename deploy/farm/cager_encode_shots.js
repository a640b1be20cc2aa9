// A job type of Flamenco, to lie in the folder `scripts` beside flamenco-manager: docs/FARM.md.
// It needs a variable `cager` in Flamenco's settings: the program on the workers, for each of their platforms.

const JOB_TYPE = {
    label: "CageR: encode shots",
    description: "One .cager file for each shot",
    settings: [
        { key: "captures", type: "string", subtype: "dir_path", required: true,
          description: "Folder that has one folder for each shot" },
        { key: "shots", type: "string", required: true, default: "1-3",
          description: "Numbers of the shots, such as 10-40 or 10,20,45" },
        { key: "shot_name", type: "string", default: "sh###",
          description: "Name of a shot's folder, with ### for its number in three digits, wherever that is" },
        { key: "rest", type: "string", default: "rest.obj",
          description: "Rest pose, in the shot's folder; ../rest.obj is one for all" },
        { key: "frames", type: "string", default: "frames.npy",
          description: "Capture, in the shot's folder" },
        { key: "cage", type: "string", default: "",
          description: "Cage, in the shot's folder; empty to have one designed for each shot" },
        { key: "prim", type: "string", default: "",
          description: "Meshes to take, with commas between them: paths, names, globs such as eye*; empty for all" },
        { key: "up", type: "string", default: "",
          description: "Axis that points up in the capture, y or z, where another one does in the rest pose" },
        { key: "unit", type: "string", default: "",
          description: "What one unit is, mm, cm, m, in or ft, in files that do not say it" },
        { key: "sample_rate", type: "float", default: 0,
          description: "Frames to take for each second of a .glb, .gltf or .fbx; 0 to take those that it has" },
        { key: "max_error", type: "float", default: 0.001,
          description: "No point of any frame is off by more than this fraction of the rest pose's diagonal" },
        { key: "output", type: "string", subtype: "dir_path", required: true,
          description: "Folder for SHOT.cager and SHOT.json; it must be there" },
        { key: "server", type: "string", default: "",
          description: "Address of a service that computes; empty to compute on the workers" },
    ]
};

function compileJob(job) {
    const settings = withDefaults(job.settings);
    if (!/#/.test(settings.shot_name)) {
        throw "shot_name: " + settings.shot_name + " is the same for all shots; give one with a number in it, such as sh###";
    }
    for (const number of frameChunker(settings.shots, 1)) {
        const shot = settings.shot_name.replace(/#+/g, (marks) => number.padStart(marks.length, "0"));
        const task = author.Task("encode-" + shot, "misc");
        task.addCommand(author.Command("exec", { exe: "{cager}", args: encodeArguments(settings, shot) }));
        job.addTask(task);
    }
}

// Jobs that do not come from Blender may leave settings out.
function withDefaults(given) {
    const settings = {};
    for (const { key, required, default: usual } of JOB_TYPE.settings) {
        settings[key] = given[key] === undefined ? usual : given[key];
        if (required && !settings[key]) {
            throw key + ": is missing; give it with the job";
        }
    }
    return settings;
}

function encodeArguments(settings, shot) {
    const inShot = (name) => path.join(settings.captures, shot, name);
    const args = ["encode", "--rest", inShot(settings.rest), "--frames", inShot(settings.frames)];
    if (settings.cage) {
        args.push("--cage", inShot(settings.cage));
    }
    for (const mesh of settings.prim.split(",").filter((mesh) => mesh.trim())) {
        args.push("--prim", mesh.trim());
    }
    for (const key of ["up", "unit", "sample_rate", "server"].filter((key) => settings[key])) {
        args.push("--" + key.replace("_", "-"), String(settings[key]));
    }
    const output = path.join(settings.output, shot);
    args.push("--max-error", String(settings.max_error), "-o", output + ".cager", "--report", output + ".json");
    // A task that is tried again replaces what an earlier try has written.
    args.push("--overwrite", "--threads", "2", "--memory", "2GB");
    return args;
}
