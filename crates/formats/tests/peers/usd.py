"""OpenUSD beside us. `usd.py read FILE` prints what the library reads of a file of one mesh: stage, faces, then a time code and the positions of each
sample, moved by the transforms above; `usd.py cages FILE` what each mesh is for and its positions; `usd.py surface FILE` what lies on the faces of each mesh; `usd.py make FOLDER` writes files that the library can write and we cannot, each in binary, as text of USD, and with a text of what is to be read; `usd.py clips FOLDER` the same of value clips."""

import sys
import zipfile

from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt


def numbers(mesh, code):
    matrix = UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(code)
    return [x for point in mesh.GetPointsAttr().Get(code) for x in matrix.Transform(Gf.Vec3d(point))]


def meshes(stage):
    return [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]


def read(path):
    stage = Usd.Stage.Open(path)
    (mesh,) = meshes(stage)
    print(UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage), stage.GetTimeCodesPerSecond(),
          stage.GetStartTimeCode(), stage.GetEndTimeCode(), mesh.GetPath(), stage.GetDefaultPrim().GetPath(),
          mesh.GetSubdivisionSchemeAttr().Get())
    print(*mesh.GetFaceVertexCountsAttr().Get())
    print(*mesh.GetFaceVertexIndicesAttr().Get())
    for code in mesh.GetPointsAttr().GetTimeSamples():
        low, high = mesh.GetExtentAttr().Get(code)
        points = mesh.GetPointsAttr().Get(code)
        assert all(low[k] == min(p[k] for p in points) and high[k] == max(p[k] for p in points) for k in range(3))
        print(repr(code), *map(repr, numbers(mesh, code)))
    if path.endswith("z"):
        with zipfile.ZipFile(path) as package:
            assert package.testzip() is None
        info = Usd.ZipFile.Open(path).GetFileInfo(package.namelist()[0]) if hasattr(Usd, "ZipFile") else None
        assert info is None or info.dataOffset % 64 == 0


def cages(path):
    stage = Usd.Stage.Open(path)
    for mesh in meshes(stage):
        print(mesh.GetPath(), UsdGeom.Imageable(mesh).ComputePurpose(), len(mesh.GetPointsAttr().Get()))
        for code in mesh.GetPointsAttr().GetTimeSamples():
            print(*map(repr, numbers(mesh, code)))


def surface(path):
    stage = Usd.Stage.Open(path)

    def material(prim):
        found, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        return found.GetPath() if found else None

    for mesh in meshes(stage):
        print(mesh.GetPath(), mesh.GetSubdivisionSchemeAttr().Get(), material(mesh.GetPrim()))
        for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvarsWithValues():
            print(primvar.GetPrimvarName(), primvar.GetTypeName(), primvar.GetInterpolation(),
                  *primvar.ComputeFlattened())
        for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh):
            print(subset.GetPrim().GetName(), subset.GetFamilyNameAttr().Get(), *subset.GetIndicesAttr().Get(),
                  material(subset.GetPrim()))
        creases = (mesh.GetCreaseIndicesAttr(), mesh.GetCreaseLengthsAttr(), mesh.GetCreaseSharpnessesAttr())
        print("creases", *(attribute.Get() for attribute in creases))
        for code in mesh.GetNormalsAttr().GetTimeSamples():
            print("normals", mesh.GetNormalsInterpolation(), code, *mesh.GetNormalsAttr().Get(code))
        print("shown", *(mesh.ComputeVisibility(code) for code in mesh.GetPointsAttr().GetTimeSamples()))
    for prim in stage.Traverse():
        if not prim.IsA(UsdShade.Material):
            continue
        shader, _, _ = UsdShade.Material(prim).ComputeSurfaceSource()
        print(prim.GetPath(), shader.GetIdAttr().Get())
        for shader_input in sorted(shader.GetInputs(), key=lambda found: found.GetBaseName()):
            print(shader_input.GetBaseName(), shader_input.Get())
            for source in shader_input.GetConnectedSources()[0]:
                picture = UsdShade.Shader(source.source.GetPrim())
                reader = UsdShade.Shader(picture.GetInput("st").GetConnectedSources()[0][0].source.GetPrim())
                file = picture.GetInput("file").Get()
                is_there = bool(file.resolvedPath)
                print(source.sourceName, file.path, is_there, picture.GetInput("sourceColorSpace").Get(),
                      reader.GetInput("varname").Get())


def make(folder):
    def begin(name, codes=(1, 4)):
        stage = Usd.Stage.CreateNew(f"{folder}/{name}.usdc")
        stage.SetTimeCodesPerSecond(25)
        stage.SetStartTimeCode(codes[0])
        stage.SetEndTimeCode(codes[1])
        return stage

    def put(stage, path):
        mesh = UsdGeom.Mesh.Define(stage, path)
        mesh.GetFaceVertexCountsAttr().Set([3])
        mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2])
        mesh.GetPointsAttr().Set([(1, 2, 3), (4, 5, 7), (-1, 0.5, 2)])
        return mesh

    def keep(stage):
        layer = stage.GetRootLayer()
        layer.Save()
        layer.Export(layer.realPath.replace(".usdc", ".usda"))

    def save(stage, prim=None):
        keep(stage)
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath(prim)) if prim else meshes(stage)[0]
        with open(stage.GetRootLayer().realPath.replace(".usdc", ".txt"), "w") as out:
            codes = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
            for code in codes:
                print(*map(repr, numbers(mesh, code)), file=out)

    # Every kind of operation, still and animated, with pivots.
    stage = begin("operations")
    top = UsdGeom.Xform.Define(stage, "/top")
    top.AddTranslateOp(opSuffix="pivot").Set((1, 2, 0.1))
    for name in ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"):
        getattr(top, f"AddRotate{name}Op")(opSuffix=name).Set((10, 200, -35.5))
    top.AddScaleOp().Set((1, 2, -0.5))
    top.AddTranslateOp(opSuffix="pivot", isInverseOp=True)
    middle = UsdGeom.Xform.Define(stage, "/top/middle")
    for name in "XYZ":
        turn = getattr(middle, f"AddRotate{name}Op")()
        turn.Set(10, 1)
        turn.Set(50.0, 3)
    quaternion = middle.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    quaternion.Set(Gf.Quatd(0.5, 0.5, -0.5, 0.5), 1)
    quaternion.Set(Gf.Quatd(0.0, 0.6, 0.8, 0), 4)
    half = middle.AddOrientOp(UsdGeom.XformOp.PrecisionHalf, "half")
    half.Set(Gf.Quath(0.5, 0.5, -0.5, 0.5))
    moving = middle.AddTransformOp()
    moving.Set(Gf.Matrix4d(1).SetTranslate((5, 6, 7.1)), 1)
    moving.Set(Gf.Matrix4d(1).SetScale((2, 3, 2)), 3)
    mesh = put(stage, "/top/middle/mesh")
    mesh.AddTranslateOp(UsdGeom.XformOp.PrecisionHalf).Set((0.5, 1, 2))
    points = mesh.GetPointsAttr()
    points.Set([(0, 0, 0), (1, 1, 1), (2, 3, 4)], 1)
    points.Set([(0, 1, 0), (1, 5, 1), (2, 3, 7)], 4)
    save(stage)

    # What resets the stack is not moved by what is above; the mesh itself stands still.
    stage = begin("reset")
    UsdGeom.Xform.Define(stage, "/a").AddTranslateOp().Set((100, 0, 0))
    inner = UsdGeom.Xform.Define(stage, "/a/b")
    inner.SetResetXformStack(True)
    scale = inner.AddScaleOp()
    scale.Set((1, 1, 1), 1)
    scale.Set((4, 4, 4), 4)
    put(stage, "/a/b/mesh")
    save(stage)

    # A single sample holds at all times, whatever the default says.
    stage = begin("single", (1, 2))
    place = UsdGeom.Xform.Define(stage, "/a").AddTranslateOp()
    place.Set((0, 0, 0))
    place.Set((5, 0, 0), 1)
    points = put(stage, "/a/mesh").GetPointsAttr()
    for code in (1, 2):
        points.Set([(code, 2, 3), (4, 5, 7), (-1, 0.5, 2)], code)
    save(stage)

    stage = begin("several")
    for path in ("/coat/body", "/skin/body", "/hat"):
        put(stage, path)
    put(stage, "/gone").GetPrim().SetActive(False)
    put(stage, "/asset").GetPrim().SetSpecifier(Sdf.SpecifierClass)
    save(stage, "/skin/body")

    stage = begin("faces", (1, 3))
    mesh = put(stage, "/mesh")
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2], 1)
    mesh.GetFaceVertexIndicesAttr().Set([0, 2, 1], 3)
    for code in (1, 2, 3):
        mesh.GetPointsAttr().Set([(code, 2, 3), (4, 5, 7), (-1, 0.5, 2)], code)
    save(stage)

    stage = begin("left", (1, 1))
    put(stage, "/mesh").GetOrientationAttr().Set("leftHanded")
    save(stage)

    # As the library does not write it of itself.
    stage = begin("doubles", (1, 1))
    put(stage, "/mesh").GetPrim().RemoveProperty("points")
    stage.GetRootLayer().Save()
    spec = Sdf.AttributeSpec(stage.GetRootLayer().GetPrimAtPath("/mesh"), "points", Sdf.ValueTypeNames.Point3dArray)
    points = [(0.1, 0.2, 0.3), (1e300, 0.0, 1.0), (0.0, 0.0, 0.0)]
    spec.default = Vt.Vec3dArray(points)
    keep(stage)
    with open(f"{folder}/doubles.txt", "w") as out:
        print(*(repr(x) for point in points for x in point), file=out)

    # What lies on faces, in the ways that the library has for it.
    stage = begin("surface", (1, 1))
    UsdGeom.Xform.Define(stage, "/root")
    roof = UsdGeom.Mesh.Define(stage, "/root/roof")
    roof.GetPointsAttr().Set([(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 1), (1, 2, 0), (0, 2, 0)])
    roof.GetFaceVertexCountsAttr().Set([4, 2, 4])
    roof.GetFaceVertexIndicesAttr().Set([0, 1, 2, 3, 0, 1, 3, 2, 4, 5])
    roof.GetSubdivisionSchemeAttr().Set("none")
    roof.GetNormalsAttr().Set([(0, -1, 1), (0, 0, 1), (0, 1, 1)])
    roof.SetNormalsInterpolation("uniform")
    primvars = UsdGeom.PrimvarsAPI(roof)
    types = Sdf.ValueTypeNames
    coordinates = primvars.CreatePrimvar("detail", types.TexCoord2fArray, "faceVarying")
    coordinates.Set([(0, 0), (0.5, 0.25)])
    coordinates.SetIndices(Vt.IntArray([0, 1, 0, 1, 0, 0, 1, 1, 1, 0]))
    primvars.CreatePrimvar("st", types.TexCoord2hArray, "vertex").Set([(k / 8, 1 - k / 8) for k in range(6)])
    primvars.CreatePrimvar("tint", types.Color3fArray, "uniform").Set([(1, 0, 0), (0, 1, 0), (0, 0, 1)])
    primvars.CreatePrimvar("all", types.Color4fArray, "constant").Set([(0.5, 0.5, 0.5, 0.25)])
    primvars.CreatePrimvar("mask", types.FloatArray, "vertex").Set([0.5] * 6)
    strip = UsdGeom.Mesh.Define(stage, "/root/group/strip")
    strip.GetPointsAttr().Set([(k, k % 2, 0) for k in range(20)])
    strip.GetFaceVertexCountsAttr().Set([3] * 18)
    strip.GetFaceVertexIndicesAttr().Set([k + j for k in range(18) for j in range(3)])
    strip.GetSubdivisionSchemeAttr().Set("loop")
    strip.GetCreaseIndicesAttr().Set(list(range(20)))
    strip.GetCreaseLengthsAttr().Set([20])
    strip.GetCreaseSharpnessesAttr().Set([2.5, 0.5] * 9 + [2.5])

    def material(name):
        return UsdShade.Material.Define(stage, "/root/looks/" + name)

    def shader(name, kind):
        made = UsdShade.Shader.Define(stage, "/root/looks/" + name)
        made.CreateIdAttr(kind)
        return made

    paint, metal = material("paint"), material("metal")
    look = shader("paint/look", "UsdPreviewSurface")
    paint.CreateSurfaceOutput().ConnectToSource(look.ConnectableAPI(), "surface")
    tint = paint.CreateInput("tint", types.Color3f)
    tint.Set((0.2, 0.4, 0.6))
    look.CreateInput("diffuseColor", types.Color3f).ConnectToSource(tint)
    look.CreateInput("roughness", types.Float).Set(0.25)
    look.CreateInput("metallic", types.Float).Set(1)
    picture = shader("paint/picture", "UsdUVTexture")
    picture.CreateInput("file", types.Asset).Set("./pictures/paint.png")
    look.CreateInput("opacity", types.Float).ConnectToSource(picture.ConnectableAPI(), "a")
    inside = UsdShade.NodeGraph.Define(stage, "/root/looks/metal/inside")
    metal.CreateSurfaceOutput().ConnectToSource(inside.CreateOutput("surface", types.Token))
    other = shader("metal/inside/other", "ND_standard_surface_surfaceshader")
    inside.GetOutput("surface").ConnectToSource(other.CreateOutput("out", types.Token))
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/root")).Bind(paint)
    patch = UsdGeom.Subset.CreateGeomSubset(roof, "patch", "face", Vt.IntArray([2]), "materialBind")
    UsdShade.MaterialBindingAPI.Apply(patch.GetPrim()).Bind(metal)
    UsdGeom.Subset.CreateGeomSubset(roof, "both", "face", Vt.IntArray([0, 1, 2]), "parts")
    keep(stage)

    for name, compose in {
        "references": lambda prim: prim.GetReferences().AddReference("./reset.usdc", "/a"),
        "payloads": lambda prim: prim.GetPayloads().AddPayload("./reset.usdc", "/a"),
        "inherited": lambda prim: prim.GetInherits().AddInherit("/class"),
        "variants": lambda prim: prim.GetVariantSets().AddVariantSet("look").AddVariant("wet"),
        "sublayers": lambda prim: prim.GetStage().GetRootLayer().subLayerPaths.append("./reset.usdc"),
    }.items():
        stage = begin(name)
        put(stage, "/group/mesh")
        compose(stage.GetPrimAtPath("/group"))
        keep(stage)


def clips(folder):
    """Three value clips with two samples each, in two kinds of layers that name them in two ways, and the points that are to be read."""
    for k, kind in enumerate(["usdc", "usda", "usdc"]):
        stage = Usd.Stage.CreateNew(f"{folder}/clip.{k + 1:03}.{kind}")
        mesh = stage.OverridePrim("/shot/m")
        points = mesh.CreateAttribute("points", Sdf.ValueTypeNames.Point3fArray)
        mesh.CreateAttribute("visibility", Sdf.ValueTypeNames.Token).Set("invisible" if k == 1 else "inherited", 2 * k)
        for code in [2 * k, 2 * k + 1]:
            points.Set(Vt.Vec3fArray([(code, 0, 0), (1, 0, 0), (0, 1, code)]), code)
        stage.GetRootLayer().Save()
    for kind in ["usda", "usdc"]:
        stage = Usd.Stage.CreateNew(f"{folder}/base.{kind}")
        mesh = UsdGeom.Mesh.Define(stage, "/root/m")
        mesh.CreateFaceVertexCountsAttr([3])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
        mesh.CreatePointsAttr([(9, 0, 0), (1, 0, 0), (0, 1, 0)])
        stage.GetRootLayer().Save()
        stage = Usd.Stage.CreateNew(f"{folder}/shot.{kind}")
        root = stage.DefinePrim("/model", "Xform")
        root.GetReferences().AddReference(f"./base.{kind}", "/root")
        api = Usd.ClipsAPI(root)
        api.SetClipAssetPaths([Sdf.AssetPath(f"./clip.{k + 1:03}.{end}") for k, end in enumerate(["usdc", "usda", "usdc"])])
        api.SetClipPrimPath("/shot")
        api.SetClipActive([(101, 0), (103, 1), (105, 2)])
        api.SetClipTimes([(101, 0), (107, 6)])
        stage.SetStartTimeCode(101)
        stage.SetEndTimeCode(106)
        stage.GetRootLayer().Save()
        points = UsdGeom.Mesh(stage.GetPrimAtPath("/model/m")).GetPointsAttr()
        with open(f"{folder}/shot.txt", "w") as told:
            for code in range(101, 107):
                print(*(f"{x:g}" for point in points.Get(code) for x in point), file=told)


{"read": read, "cages": cages, "surface": surface, "make": make, "clips": clips}[sys.argv[1]](sys.argv[2])
