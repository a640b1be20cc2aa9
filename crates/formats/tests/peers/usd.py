"""OpenUSD beside us. `usd.py read FILE` prints what the library reads of a file of one mesh: stage, faces, then a time code and the positions of each
sample, moved by the transforms above; `usd.py cages FILE` what each mesh is for and its positions; `usd.py make FOLDER` writes files that the library can write and we cannot, each in binary, as text of USD, and with a text of what is to be read."""

import sys
import zipfile

from pxr import Gf, Sdf, Usd, UsdGeom, Vt


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


{"read": read, "cages": cages, "make": make}[sys.argv[1]](sys.argv[2])
