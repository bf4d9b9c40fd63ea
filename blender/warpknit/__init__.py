"""Warpknit in Blender: yarns of a warp-knit or weft-knit fabric as curves on a garment.

In: a garment object and settings, in the sidebar of the 3D view. Out: a curve object that knows its garment. A handler knits it
again whenever the frame changes, so yarns follow a simulated or animated garment, in renders too.
"""

import math
import warnings

import bpy
import warpknit
from bpy.app.handlers import persistent
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import knit

# Blender keeps no reference to the texts of a list of choices, so the list must live as long as the module.
FABRICS = [(name, name, warpknit.Fabric.named(name).about) for name in warpknit.Fabric.names()]
MAPPINGS = [
    ("relaxed", "Relaxed", "Yarn keeps its length: loops change as the cloth is strained"),
    ("smooth", "Smooth", "Loops are stretched with the cloth. Faster, for many frames"),
]


def is_mesh(_settings, candidate):
    return candidate.type == "MESH"


class WarpknitSettings(bpy.types.PropertyGroup):
    """What is knitted, and on what."""

    garment: PointerProperty(
        name="Garment", description="The draped garment. Its UV map is the pattern, if no flat object is given", type=bpy.types.Object, poll=is_mesh
    )
    flat: PointerProperty(
        name="Flat", description="The flat pattern: an object with the same faces. Without one the UV map is taken", type=bpy.types.Object, poll=is_mesh
    )
    fabric: EnumProperty(name="Fabric", description="A built-in fabric", items=FABRICS, default="locknit")
    lapping: StringProperty(
        name="Lapping", description="Chains in place of the fabric's, front bar first, with blanks between: 2-3/1-0// 1-0/1-2//"
    )
    wales_per_cm: FloatProperty(
        name="Wales per cm", description="0 takes so few that about 12 000 stitches remain", min=0.0, soft_max=30.0, max=1000.0, default=0.0
    )
    mapping: EnumProperty(name="Mapping", description="How loops lie on the body", items=MAPPINGS, default="relaxed")
    grain: FloatProperty(
        name="Grain", description="Turns the wales on the panels", subtype="ANGLE", unit="ROTATION", default=0.0
    )
    turn: BoolProperty(name="Turn", description="The technical face on the other side of the cloth")
    samples: IntProperty(name="Points a stitch", description="Points of the curves in each stitch", min=2, max=64, default=12)
    follow: BoolProperty(name="Follow frames", description="Knit again whenever the frame changes", default=True)


def build(target, context_scene, depsgraph):
    """Knits the curves of an object again."""
    settings = target.warpknit
    fabric = knit.fabric_of(settings.fabric, settings.lapping)
    degrees = math.degrees(settings.grain)
    garment = knit.garment_of(settings.garment, settings.flat, context_scene, depsgraph, degrees, settings.turn)
    # Blender's numbers have 32 bits: 0.01 is a little less.
    yarns = warpknit.drape(garment, fabric, round(settings.wales_per_cm, 6) or None, settings.mapping)
    knit.fill(target.data, yarns, context_scene, settings.samples)
    return yarns


def tried(operator, target, context):
    """What `build` returns, or None where it can't be knitted. The operator reports that, and warnings."""
    yarns, failure = None, None
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yarns = build(target, context.scene, context.evaluated_depsgraph_get())
        except (knit.KnitError, ValueError, MemoryError) as error:
            failure = str(error)
    told = [str(warning.message) for warning in caught]
    if failure is not None:
        # Blender shows one error. The warnings before it may name its cause.
        operator.report({"ERROR"}, ". ".join([*told, failure]))
        return None
    for text in told:
        operator.report({"WARNING"}, text)
    return yarns


def copied(settings, target):
    """Gives an object the settings of the panel."""
    for name in WarpknitSettings.__annotations__:
        setattr(target.warpknit, name, getattr(settings, name))


class WARPKNIT_OT_knit(bpy.types.Operator):
    """Knit the fabric onto the garment, as a new curve object"""

    bl_idname = "warpknit.knit"
    bl_label = "Knit"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.scene.warpknit.garment is not None

    def execute(self, context):
        settings = context.scene.warpknit
        curves = bpy.data.curves.new(f"{settings.garment.name} yarns", "CURVE")
        target = bpy.data.objects.new(curves.name, curves)
        copied(settings, target)
        yarns = tried(self, target, context)
        if yarns is None:
            bpy.data.curves.remove(curves)
            return {"CANCELLED"}
        context.collection.objects.link(target)
        self.report({"INFO"}, f"{yarns.stitches} stitches in {len(yarns)} strands")
        return {"FINISHED"}


class WARPKNIT_OT_rebuild(bpy.types.Operator):
    """Knit the active yarns again, after their garment or settings have changed"""

    bl_idname = "warpknit.rebuild"
    bl_label = "Knit again"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        active = context.object
        return active is not None and active.type == "CURVE" and active.warpknit.garment is not None

    def execute(self, context):
        return {"CANCELLED"} if tried(self, context.object, context) is None else {"FINISHED"}


class WARPKNIT_PT_panel(bpy.types.Panel):
    """The settings, in the sidebar of the 3D view"""

    bl_label = "Warpknit"
    bl_idname = "WARPKNIT_PT_panel"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Warpknit"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        active = context.object
        is_yarns = active is not None and active.type == "CURVE" and active.warpknit.garment is not None
        # Yarns that are selected show their own settings; otherwise those of the next ones are shown.
        settings = active.warpknit if is_yarns else context.scene.warpknit
        for name in WarpknitSettings.__annotations__:
            layout.prop(settings, name)
        layout.operator("warpknit.rebuild" if is_yarns else "warpknit.knit")


def check_is_evaluated(garment, depsgraph):
    """Refuses a garment that a render leaves out: its shape in the new frame isn't known."""
    if depsgraph.mode == "RENDER" and garment not in {each.original for each in depsgraph.objects}:
        raise knit.KnitError(
            f"{garment.name} is hidden in renders, so yarns can't follow it; hide it with Object Properties > Visibility > Ray Visibility"
        )


@persistent
def follow(scene, depsgraph):
    """Knits all yarns that follow their garments again, for the new frame."""
    for target in scene.objects:
        if target.type == "CURVE" and target.warpknit.follow and target.warpknit.garment is not None:
            try:
                check_is_evaluated(target.warpknit.garment, depsgraph)
                build(target, scene, depsgraph)
            except (knit.KnitError, ValueError, MemoryError) as error:
                # The yarns of the last frame stay. A handler has no other way to say so.
                print(f"warpknit: {target.name}, frame {scene.frame_current}: {error}")


CLASSES = (WarpknitSettings, WARPKNIT_OT_knit, WARPKNIT_OT_rebuild, WARPKNIT_PT_panel)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.warpknit = PointerProperty(type=WarpknitSettings)
    bpy.types.Object.warpknit = PointerProperty(type=WarpknitSettings)
    bpy.app.handlers.frame_change_post.append(follow)


def unregister():
    bpy.app.handlers.frame_change_post.remove(follow)
    del bpy.types.Object.warpknit
    del bpy.types.Scene.warpknit
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
