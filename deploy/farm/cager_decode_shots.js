// A job type of Flamenco, to lie in the folder `scripts` beside flamenco-manager: docs/FARM.md.
// It needs a variable `cager` in Flamenco's settings: the program on the workers, for each of their platforms.

const JOB_TYPE = {
    label: "CageR: decode shots",
    description: "Each shot's .cager file in another format",
    settings: [
        { key: "containers", type: "string", subtype: "dir_path", required: true,
          description: "Folder that has SHOT.cager for each shot" },
        { key: "shots", type: "string", required: true, default: "1-3",
          description: "Numbers of the shots, such as 10-40 or 10,20,45" },
        { key: "shot_name", type: "string", default: "sh###",
          description: "Name of a shot, with ### for its number in three digits, wherever that is" },
        { key: "format", type: "string", default: "usdc",
          choices: ["usdc", "usdz", "abc", "glb", "gltf", "vat", "obj", "ply", "npy", "pc2", "mdd", "mcx"],
          description: "What is written; obj and ply are a folder with a file for each frame" },
        { key: "part", type: "string", default: "",
          description: "Parts to write, with commas between them: paths, names, globs such as eye*; empty for all" },
        { key: "onto", type: "string", default: "",
          description: "File of USD that the shots came from, in the shot's folder; layers on top of it are written" },
        { key: "captures", type: "string", subtype: "dir_path", default: "",
          description: "Folder that has one folder for each shot, where layers are written on top of files there" },
        { key: "output", type: "string", subtype: "dir_path", required: true,
          description: "Folder for SHOT.usdc, or as the format is called; it must be there" },
    ]
};

// Folders with a file for each frame, and one of textures.
const ENDINGS = { obj: "/", ply: "/*.ply", vat: ".vat/" };

function compileJob(job) {
    const settings = withDefaults(job.settings);
    if (!/#/.test(settings.shot_name)) {
        throw "shot_name: " + settings.shot_name + " is the same for all shots; give one with a number in it, such as sh###";
    }
    for (const number of frameChunker(settings.shots, 1)) {
        const shot = settings.shot_name.replace(/#+/g, (marks) => number.padStart(marks.length, "0"));
        const task = author.Task("decode-" + shot, "misc");
        task.addCommand(author.Command("exec", { exe: "{cager}", args: decodeArguments(settings, shot) }));
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

function decodeArguments(settings, shot) {
    const args = ["decode", path.join(settings.containers, shot + ".cager")];
    if (settings.onto) {
        if (!settings.captures) {
            throw "onto: lies in the shot's folder; give the folder of these as captures";
        }
        args.push("--onto", path.join(settings.captures, shot, settings.onto));
    }
    for (const part of settings.part.split(",").filter((part) => part.trim())) {
        args.push("--part", part.trim());
    }
    args.push("-o", path.join(settings.output, shot) + (ENDINGS[settings.format] || "." + settings.format));
    // A task that is tried again replaces what an earlier try has written.
    args.push("--overwrite", "--threads", "2", "--memory", "2GB");
    return args;
}
