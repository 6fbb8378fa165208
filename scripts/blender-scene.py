"""A scene for Blender's Cycles: subdivided meshes, instances, glass and a surface that is half there, under a square light.

    blender -b --factory-startup --python scripts/blender-scene.py -- PICTURE.tga still|blurred

Nothing touches anything in a plane, where each engine chooses what is in front.
"""

import sys

import bpy

path, way = sys.argv[sys.argv.index("--") + 1 :]

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.device = "CPU"
scene.cycles.samples = 16
scene.cycles.use_denoising = False
scene.render.resolution_x, scene.render.resolution_y = 240, 160
scene.render.image_settings.file_format = "TARGA_RAW"
scene.render.image_settings.color_mode = "RGB"
scene.render.filepath = path
scene.view_settings.view_transform = "Standard"


def material(name, **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    for key, value in inputs.items():
        made.node_tree.nodes["Principled BSDF"].inputs[key.replace("_", " ")].default_value = value
    return made


bpy.ops.mesh.primitive_plane_add(size=12)
bpy.ops.mesh.primitive_monkey_add(location=(0, 0, 1.1), size=2)
monkey = bpy.context.object
subdivision = monkey.modifiers.new("subdivision", "SUBSURF")
subdivision.levels = subdivision.render_levels = 2
monkey.data.materials.append(material("clay", Base_Color=(0.8, 0.3, 0.1, 1)))
for i in range(6):
    copy = bpy.data.objects.new(f"copy {i}", monkey.data)
    copy.location, copy.scale, copy.rotation_euler = (-3 + 1.2 * i, 2.5, 0.6), (0.5, 0.5, 0.5), (0, 0, i)
    bpy.context.collection.objects.link(copy)
bpy.ops.mesh.primitive_uv_sphere_add(location=(2, -1, 0.7), radius=0.6)
bpy.ops.object.shade_smooth()
bpy.context.object.data.materials.append(material("glass", Transmission=1, Roughness=0))
bpy.ops.mesh.primitive_cube_add(location=(-2, -1, 0.52), size=1)
bpy.context.object.data.materials.append(material("veil", Alpha=0.5))
bpy.ops.object.light_add(type="AREA", location=(3, -3, 5), rotation=(0.7, 0.3, 0.4))
bpy.context.object.data.energy, bpy.context.object.data.size = 500, 2
bpy.ops.object.camera_add(location=(0, -7, 3.2), rotation=(1.2, 0, 0))
scene.camera = bpy.context.object
if way == "blurred":
    scene.render.use_motion_blur = True
    for frame, location in [(1, (0, 0, 1.1)), (3, (0.8, 0, 1.4))]:
        monkey.location = location
        monkey.keyframe_insert("location", frame=frame)
    scene.frame_set(2)
bpy.ops.render.render(write_still=True)
