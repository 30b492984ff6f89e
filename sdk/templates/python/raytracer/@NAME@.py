"""@NAME@: a ray tracer for arhost. The first part traces rays; the last is the plugin, which turns cameras into rays
and samples into images.

Brute force: tests each ray against every object whose bounding sphere it hits, and there against every sphere or
triangle, with numpy, for the rays of a few image rows at a time. All positions are in world coordinates, mm."""
import arhost
import numpy as np

BAND = 1 << 12  # pixels rendered at a time; limits the memory of deep recursion
CHUNK = 1 << 18  # ray–triangle pairs tested at a time


def dot(a, b):
    return (a * b).sum(axis=-1)


def length(a):
    return np.sqrt(dot(a, a))


def normalised(a):
    return a / length(a)[..., None]


# ---- Scene. FILL IN: replace everything from here to the plugin ----

# Kinds of objects, as bits of a ray mask. Glass and solid objects cast different shadows.
SOLID, GLASS, CATCHER, OCCLUDER, ALL_KINDS = 1, 2, 4, 8, 15


class Object:
    """An object in world coordinates: spheres or triangles."""

    def __init__(self, record, material):
        self.material = material
        self.is_visible = True  # rays pass through invisible objects
        self.kind = {arhost.ROLE_CATCHER: CATCHER, arhost.ROLE_OCCLUDER: OCCLUDER}.get(
            int(record["role"]), GLASS if material["model"] == arhost.MATERIAL_GLASS else SOLID)

    def update(self, scene, geometry, world_from_object, positions=None, normals=None):
        """Transforms its geometry to world coordinates; `positions` and `normals` replace those of the scene."""
        axes, origin = np.split(world_from_object.astype(float).reshape(4, 3), [3])
        self.is_mesh = geometry["type"] == arhost.GEOMETRY_TRIANGLES
        if not self.is_mesh:
            spheres = scene.elements(geometry["positions"], "4f4").astype(float)
            self.centres, self.radii = spheres[:, :3] @ axes + origin, spheres[:, 3] * length(axes[0])
            return self.bound(self.centres, self.radii)
        if positions is None:
            positions = scene.elements(geometry["positions"], "3f4")
            normals = scene.elements(geometry["normals"], "3f4")
        indices = scene.elements(geometry["indices"], "3u4")
        corners = (positions.astype(float) @ axes + origin)[indices]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        usable = length(across) > 0  # the others have zero area and no normal
        self.corner = corners[usable, 0]
        self.edge_1, self.edge_2 = corners[usable, 1] - self.corner, corners[usable, 2] - self.corner
        # Normals transform by the inverse transpose. Its sign keeps the normals of a mirrored object pointing outwards.
        sign = np.sign(np.linalg.det(axes))
        self.face_normals = sign * normalised(across[usable])
        self.normals = np.repeat(self.face_normals[:, None], 3, axis=1)
        if normals is not None and len(normals):
            self.normals = normalised(normals.astype(float) @ np.linalg.inv(axes).T)[indices[usable]]
        self.bound(corners.reshape(-1, 3), 0)

    def bound(self, centres, radii):
        """Sets the bounding sphere, around the centre of the bounding box."""
        r = np.zeros((len(centres), 1)) + np.reshape(radii, (-1, 1))
        self.centre = ((centres - r).min(axis=0) + (centres + r).max(axis=0)) / 2
        self.radius = (length(centres - self.centre) + r[:, 0]).max() * (1 + 1e-9)  # margin for rounding


# ---- Intersections ----

def sphere_interval(centre, radius, origins, directions):
    """Distances at which the rays' lines enter and leave a sphere; NaN if they miss."""
    to_centre = centre - origins
    centre_distance = dot(to_centre, directions)
    aside = to_centre - centre_distance[:, None] * directions
    squared = radius ** 2 - dot(aside, aside)
    half = np.sqrt(np.where(squared > 0, squared, np.nan))
    return centre_distance - half, centre_distance + half


class Hits:
    """The nearest hit of each ray."""

    def __init__(self, count, end):
        self.distance = np.zeros(count) + end
        self.object = np.full(count, -1)  # index; -1: no hit
        self.face_normal = np.zeros((count, 3))  # geometric normal, unit length
        self.normal = np.zeros((count, 3))  # shading normal, unit length
        self.lift = np.zeros((count, 3))  # from the hit to the origin of shadow rays

    def take(self, rays, number, distance, face_normal, normal, lift):
        nearer = (distance > 0) & (distance < self.distance[rays])  # false for NaN
        rays = rays[nearer]
        self.distance[rays], self.object[rays] = distance[nearer], number
        self.face_normal[rays], self.normal[rays] = face_normal[nearer], normal[nearer]
        self.lift[rays] = lift[nearer]


def intersect_spheres(hits, number, o, rays, origins, directions, front_faces_only):
    for centre, radius in zip(o.centres, o.radii):
        enters, leaves = sphere_interval(centre, radius, origins, directions)
        distance = enters if front_faces_only else np.where(enters > 0, enters, leaves)
        normal = (origins + distance[:, None] * directions - centre) / radius
        hits.take(rays, number, distance, normal, normal, np.zeros(normal.shape))


def intersect_triangles(hits, number, o, part, rays, origins, directions, front_faces_only):
    """Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, Journal of Graphics Tools 2(1), 1997. The
    scalar triple products of all rays and triangles are matrix products."""
    epsilon = 1e-9  # prevents gaps between triangles with a common edge
    corner, edge_1, edge_2 = o.corner[part], o.edge_1[part], o.edge_2[part]
    moments = np.cross(origins, directions)
    # (origin − corner) · (direction × edge) = edge · (origin × direction) − direction · (edge × corner)
    determinant = -directions @ np.cross(edge_1, edge_2).T
    u = (moments @ edge_2.T - directions @ np.cross(edge_2, corner).T) / determinant
    v = -(moments @ edge_1.T - directions @ np.cross(edge_1, corner).T) / determinant
    normals = np.cross(edge_1, edge_2)
    distance = (origins @ normals.T - dot(corner, normals)) / determinant
    hit = (u >= -epsilon) & (v >= -epsilon) & (u + v <= 1 + epsilon) & (distance > 0)
    if front_faces_only:
        hit &= directions @ o.face_normals[part].T <= 0
    distance = np.where(hit, distance, np.inf)
    which, every = distance.argmin(axis=1), np.arange(len(rays))
    nearest = distance[every, which]
    found = np.isfinite(nearest)
    if not found.any():
        return
    which, every = which[found], every[found]
    u, v = u[every, which, None], v[every, which, None]
    normals, weights = o.normals[part][which], np.stack((1 - u - v, u, v), axis=1)
    normal = (weights * normals).sum(axis=1)
    # Vectors to the corners, then from the hit to the curved surface that the normals describe. Shadow rays start there,
    # so that the facets of a smooth mesh do not shadow themselves (J. Hanika, Hacking the Shadow Terminator, Ray Tracing
    # Gems II, 2021).
    along_1, along_2 = edge_1[which], edge_2[which]
    to_corners = np.stack((np.zeros(along_1.shape), along_1, along_2), axis=1) - (u * along_1 + v * along_2)[:, None]
    lift = (weights * np.maximum(dot(to_corners, normals), 0)[..., None] * normals).sum(axis=1)
    hits.take(rays[found], number, nearest[found], o.face_normals[part][which], normalised(normal), lift)


class Tracer:
    def __init__(self, scene, host):
        self.scene, self.host = scene, host
        self.objects = [Object(record, scene.materials[record["material"]]) for record in scene.objects]
        for number, record in enumerate(scene.objects):
            self.update_object(number, record["world_from_object"])

    def update_object(self, number, *state):
        self.objects[number].update(self.scene, self.scene.geometries[self.scene.objects[number]["geometry"]], *state)

    def update(self, moved, deformed):
        """Applies the animated state."""
        transforms = {int(m["object"]): m["world_from_object"] for m in moved}
        for m in moved:
            self.objects[m["object"]].is_visible = bool(m["is_visible"])
        for number, transform in transforms.items():
            self.update_object(number, transform)
        for d in deformed:
            self.objects[d.object].is_visible = d.is_visible
            transform = transforms.get(d.object, self.scene.objects[d.object]["world_from_object"])
            self.update_object(d.object, transform, d.positions, d.normals)

    def check_cancelled(self):
        if self.host.cancelled():  # arhost wants this call to return soon
            raise arhost.Failure("", arhost.STATUS_ERROR_CANCELLED)

    def nearest(self, origins, directions, kinds, end=np.inf, front_faces_only=False):
        self.check_cancelled()
        hits = Hits(len(origins), end)
        for number, o in enumerate(self.objects):
            if not o.is_visible or not o.kind & kinds:
                continue
            enters, leaves = sphere_interval(o.centre, o.radius, origins, directions)
            rays = np.flatnonzero((enters < hits.distance) & (leaves > 0))
            if len(rays) == 0:
                continue
            if not o.is_mesh:
                intersect_spheres(hits, number, o, rays, origins[rays], directions[rays], front_faces_only)
                continue
            step = max(1, CHUNK // len(rays))
            for first in range(0, len(o.corner), step):
                self.check_cancelled()
                intersect_triangles(hits, number, o, slice(first, first + step), rays, origins[rays], directions[rays],
                                    front_faces_only)
        return hits

    # ---- Shading ----

    def incoming(self, light, surface):
        """The light that arrives at each surface point: direction to the light, distance, cosine to the normal (0 if
        the light is behind the surface), irradiance at normal incidence for an intensity of 1. FILL IN: area lights
        emit from their centre only; sample many points on them for soft shadows."""
        beam, irradiance = light["direction"].astype(float), np.ones(len(surface.position))
        if light["type"] == arhost.LIGHT_DIRECTIONAL:
            direction, distance = np.broadcast_to(-beam, surface.position.shape), np.inf * irradiance
        else:
            to_light = light["position"] - surface.position
            distance = length(to_light)
            direction = to_light / distance[:, None]
            if light["falloff"] == arhost.FALLOFF_INVERSE_SQUARE:
                irradiance = 1 / np.maximum(distance ** 2, 1e-6)
        along_beam = -direction @ beam
        if light["type"] == arhost.LIGHT_RECTANGLE:
            irradiance = irradiance * np.maximum(along_beam, 0)
        if light["type"] == arhost.LIGHT_SPOT:
            inner, outer = float(light["cosine_inner"]), float(light["cosine_outer"])
            t = np.clip((along_beam - outer) / max(inner - outer, 1e-6), 0, 1)
            irradiance = irradiance * t * t * (3 - 2 * t)
        cosine = np.maximum(dot(surface.normal, direction), 0)
        return direction, distance, cosine, irradiance

    def visibility(self, direction, distance, surface, facing):
        """For the points that face a light: whether it is blocked, and whether it is visible through glass. Proxies for
        real objects cast no shadows on each other: the video already contains those."""
        if np.isfinite(distance[:1]).all():  # not a directional light
            to_light = surface.position + distance[:, None] * direction - surface.lifted
            distance = length(to_light)
            direction = to_light / distance[:, None]
        blocked, through_glass = np.zeros((2, len(facing)), bool)
        for real, opaque in ((False, SOLID | CATCHER | OCCLUDER), (True, SOLID)):
            some = np.flatnonzero(facing & (surface.is_real == real))
            rays = surface.lifted[some], direction[some]
            blocked[some] = self.nearest(*rays, opaque, distance[some]).object >= 0
            through_glass[some] = self.nearest(*rays, GLASS, distance[some]).object >= 0
        return blocked, through_glass & ~blocked

    def direct_light(self, surface, material, to_eye):
        """Lambert and Phong."""
        radiance = np.zeros(surface.position.shape) + self.scene.ambient * material["ambient"] + material["emission"]
        for light in self.scene.lights:
            direction, distance, cosine, irradiance = self.incoming(light, surface)
            blocked, _ = self.visibility(direction, distance, surface, cosine * irradiance > 0)
            reflected = cosine[:, None] * material["diffuse"]
            if material["model"] in (arhost.MATERIAL_SPECULAR, arhost.MATERIAL_METAL):
                mirrored = 2 * dot(surface.normal, direction)[:, None] * surface.normal - direction
                lobe = np.maximum(dot(mirrored, to_eye), 0) ** float(material["exponent"]) * (cosine > 0)
                reflected = reflected + lobe[:, None] * material["specular"]
            radiance += (irradiance * ~blocked)[:, None] * reflected * light["intensity"]
        return radiance

    def radiance(self, origins, directions, hits, bounces=0):
        """FILL IN: not implemented: textures, environment maps, microfacets (metallic-roughness is shaded as Lambert),
        and refraction, reflection and absorption of glass."""
        result = np.zeros(origins.shape) + self.scene.background
        for number in np.unique(hits.object[hits.object >= 0]):
            here = np.flatnonzero(hits.object == number)
            material, directions_here = self.objects[number].material, directions[here]
            surface = Surface(origins[here], directions_here, hits, here, self.objects[number].kind)
            cosine = -dot(directions_here, surface.normal)[:, None]
            mirrored = directions_here + 2 * cosine * surface.normal
            if material["model"] == arhost.MATERIAL_MIRROR:
                colour = material["reflectivity"] * self.trace_secondary(surface.position, mirrored, bounces + 1)
            elif material["model"] == arhost.MATERIAL_METAL:
                schlick = (1 - np.clip(cosine, 0, 1)) ** 5
                reflectance = (1 - schlick) * material["reflectivity"] + schlick
                colour = self.direct_light(surface, material, -directions_here) + \
                    reflectance * self.trace_secondary(surface.position, mirrored, bounces + 1)
            elif material["model"] == arhost.MATERIAL_GLASS:
                colour = material["refraction"] * self.trace_secondary(surface.below, directions_here, bounces + 1)
            else:
                colour = self.direct_light(surface, material, -directions_here)
            result[here] = colour
        return result

    def trace_secondary(self, origins, directions, bounces):
        if bounces > self.scene.max_depth:
            return np.zeros(origins.shape)
        return self.radiance(origins, directions, self.nearest(origins, directions, ALL_KINDS), bounces)

    # ---- Overlay ----

    def shadow_alphas(self, surface):
        """Shadow on a catcher. The host composites in sRGB, but a shadow hides a share of the linear light: alpha is exact
        for mid-grey video, the sRGB value 0.5."""
        grey = linear_light(0.5)
        hidden_by_opaque = grey - linear_light(0.5 * (1 - self.scene.shadow_alpha_opaque))
        hidden_by_glass = grey - linear_light(0.5 * (1 - self.scene.shadow_alpha_translucent))
        total, hidden = np.zeros((2, len(surface.position)))
        for light in self.scene.lights:
            direction, distance, cosine, irradiance = self.incoming(light, surface)
            power = cosine * irradiance * light["intensity"].astype(float).sum()
            blocked, through_glass = self.visibility(direction, distance, surface, power > 0)
            total += power
            hidden += power * (blocked * hidden_by_opaque + through_glass * hidden_by_glass)
        return 1 - 2 * srgb(grey - hidden / np.maximum(total, 1e-300))

    def trace(self, origins, directions):
        """Overlay colours, in linear light, and alphas: exactly 0 where only the video is visible, exactly 1 on virtual
        objects."""
        hits = self.nearest(origins, directions, SOLID | GLASS | OCCLUDER)
        kinds = np.array([o.kind for o in self.objects] + [0])[hits.object]  # index -1: no hit, kind 0
        virtual = (kinds & (SOLID | GLASS)) != 0
        hits.object[~virtual] = -1
        alphas = virtual.astype(float)
        colours = self.radiance(origins, directions, hits) * virtual[:, None]
        # The video shows the real surface; the overlay adds only the shadow.
        rest = np.flatnonzero(~virtual)
        caught = self.nearest(origins[rest], directions[rest], CATCHER, hits.distance[rest], front_faces_only=True)
        on_catcher = np.flatnonzero(caught.object >= 0)
        rest = rest[on_catcher]
        alphas[rest] = self.shadow_alphas(Surface(origins[rest], directions[rest], caught, on_catcher, CATCHER))
        return colours, alphas


class Surface:
    """The points hit by rays; `here` are their indices in `hits`."""

    def __init__(self, origins, directions, hits, here, kind):
        distance = hits.distance[here, None]
        at = origins + distance * directions
        face_normal, normal = hits.face_normal[here], hits.normal[here]
        # Both normals face the rays' origins.
        face_normal = np.where(dot(face_normal, directions)[:, None] > 0, -face_normal, face_normal)
        inside = dot(normal, face_normal)[:, None] < 0
        self.normal = np.where(inside, -normal, normal)
        gap = 1e-9 * (length(at)[:, None] + distance) * face_normal
        self.position, self.below = at + gap, at - gap  # offsets, so that secondary rays do not hit it again
        self.lifted = np.where(inside, self.position, self.position + hits.lift[here])  # origin of shadow rays
        self.is_real = np.full(len(at), bool(kind & (CATCHER | OCCLUDER)))


# ---- Plugin ----

def srgb(linear):
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear_light(encoded):
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4


def to_bytes(values):
    return (255 * np.clip(values, 0, 1) + 0.5).astype(np.uint8)


class @CLASS@:
    # FILL IN: what you implement, such as arhost.RAYTRACER_CAPABILITY_TEXTURES. arhost warns if a scene needs more.
    capabilities = arhost.RAYTRACER_CAPABILITY_REFLECTION | arhost.RAYTRACER_CAPABILITY_MOTION

    # Further arguments come from the YAML: options: {arguments: '{"colour": [0, 0.5, 1]}'}
    def __init__(self, host):
        self.host = host  # host.info("…") logs; poll host.cancelled() in long loops

    def start(self, setup):
        self.tracer = Tracer(setup.scene, self.host)

    def stop(self):
        self.tracer = None  # the scene becomes invalid

    @np.errstate(divide="ignore", invalid="ignore")  # misses yield NaN, which fails every comparison
    def render(self, request, image):
        camera, lens = request.camera, request.camera.intrinsics
        back = camera.eye - camera.look_at
        right = np.cross(camera.up, back)
        if not length(right) > 1e-9 * length(camera.up) * length(back):  # false for NaN too
            raise arhost.Failure("the camera's up vector is parallel to its viewing direction",
                                 arhost.STATUS_ERROR_INVALID_ARGUMENT)
        right, back = normalised(right), normalised(back)
        up = np.cross(back, right)
        self.tracer.update(request.moved, request.deformed)

        height, width = image.shape[:2]
        step = max(1, BAND // width)
        for first in range(0, height, step):
            band = image[first:first + step]
            # One ray per pixel. Pixel centres are at integers, rows go downwards, the camera looks along -back.
            rows, columns = np.mgrid[first:first + len(band), 0:width].reshape(2, -1)
            x, y = (columns - lens.cx) / lens.fx, (rows - lens.cy) / lens.fy
            directions = normalised(x[:, None] * right - y[:, None] * up - back)
            colours, alphas = self.tracer.trace(np.broadcast_to(camera.eye, directions.shape), directions)
            # Straight alpha: colours are not multiplied by it.
            band[..., :3] = to_bytes(srgb(colours)).reshape(band.shape[:2] + (3,))
            band[..., 3] = to_bytes(alphas).reshape(band.shape[:2])
