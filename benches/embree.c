/* Times Embree's 16-wide coherent closest hits on the rays that `speed.rs` hands over.
 *
 *   embree LIBRARY INPUT THREADS
 *
 * INPUT, little-endian: u32 vertices, faces, sensors, directions; f32 range; f32[3] a vertex,
 * u32[3] a face, f32[3][4] a sensor (rotation rows, each with its coordinate), f32[3] a direction.
 * For each line on stdin one pass over all rays; prints "seconds hits" for it.
 * The library is opened at run time and its interface (version 4) declared here, so that neither
 * headers nor a particular library are needed to build. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define W 16
enum { INDEX = 0, VERTEX = 1, UINT3 = 0x5003, FLOAT3 = 0x9003, COHERENT = 1 << 16 };
struct ray_hit {
    float org[3][W], tnear[W], dir[3][W], time[W], tfar[W];
    uint32_t mask[W], id[W], flags[W];
    float normal[3][W], u[W], v[W];
    uint32_t prim[W], geom[W], instance[16][W];
} __attribute__((aligned(64)));
struct arguments {
    int flags;
    uint32_t features;
    void *context, *filter, *intersect;
    float min_width;
};

static void *scene;
static void (*intersect16)(const int *, void *, struct ray_hit *, struct arguments *);
static uint32_t n[4];
static float range;
static float (*poses)[3][4], (*directions)[3];
static int threads;

static void *pass(void *arg) {
    uintptr_t thread = (uintptr_t)arg, hits = 0;
    struct ray_hit r;
    struct arguments args = {.flags = COHERENT, .features = ~0u};
    int valid[W] __attribute__((aligned(64)));
    for (uint32_t s = thread; s < n[2]; s += threads)
        for (uint32_t first = 0; first < n[3]; first += W) {
            for (int i = 0; i < W; i++) {
                uint32_t d = first + i < n[3] ? first + i : n[3] - 1;
                valid[i] = first + i < n[3] ? -1 : 0;
                for (int k = 0; k < 3; k++) {
                    float *row = poses[s][k];
                    r.org[k][i] = row[3];
                    r.dir[k][i] = row[0] * directions[d][0] + row[1] * directions[d][1] + row[2] * directions[d][2];
                }
                r.tnear[i] = r.time[i] = 0;
                r.tfar[i] = range;
                r.mask[i] = ~0u;
                r.id[i] = r.flags[i] = 0;
                r.geom[i] = r.prim[i] = ~0u;
                r.instance[0][i] = r.instance[1][i] = ~0u;
            }
            intersect16(valid, scene, &r, &args);
            for (int i = 0; i < W; i++) hits += valid[i] && r.geom[i] != ~0u;
        }
    return (void *)hits;
}

static void *get(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (!found) { fprintf(stderr, "%s\n", dlerror()); exit(2); }
    return found;
}

int main(int argc, char **argv) {
    if (argc != 4) return 2;
    void *library = dlopen(argv[1], RTLD_NOW);
    if (!library) { fprintf(stderr, "%s\n", dlerror()); return 2; }
    FILE *in = fopen(argv[2], "rb");
    if (!in || fread(n, 4, 4, in) != 4 || fread(&range, 4, 1, in) != 1) return 2;
    threads = atoi(argv[3]);
    float *vertices = malloc((size_t)n[0] * 12 + 16);
    uint32_t *faces = malloc((size_t)n[1] * 12 + 16);
    poses = malloc((size_t)n[2] * 48);
    directions = malloc((size_t)n[3] * 12);
    if (fread(vertices, 12, n[0], in) != n[0] || fread(faces, 12, n[1], in) != n[1] ||
        fread(poses, 48, n[2], in) != n[2] || fread(directions, 12, n[3], in) != n[3]) return 2;

    void *(*new_device)(const char *) = get(library, "rtcNewDevice");
    void *(*new_scene)(void *) = get(library, "rtcNewScene");
    void *(*new_geometry)(void *, int) = get(library, "rtcNewGeometry");
    void (*set_buffer)(void *, int, unsigned, int, const void *, size_t, size_t, size_t) =
        get(library, "rtcSetSharedGeometryBuffer");
    void (*commit_geometry)(void *) = get(library, "rtcCommitGeometry");
    unsigned (*attach)(void *, void *) = get(library, "rtcAttachGeometry");
    void (*commit_scene)(void *) = get(library, "rtcCommitScene");
    int (*get_error)(void *) = get(library, "rtcGetDeviceError");
    intersect16 = get(library, "rtcIntersect16");

    void *device = new_device(NULL);
    scene = new_scene(device);
    void *geometry = new_geometry(device, 0);
    set_buffer(geometry, VERTEX, 0, FLOAT3, vertices, 0, 12, n[0]);
    set_buffer(geometry, INDEX, 0, UINT3, faces, 0, 12, n[1]);
    commit_geometry(geometry);
    attach(scene, geometry);
    commit_scene(scene);
    if (get_error(device)) { fprintf(stderr, "Embree refused the scene\n"); return 2; }

    char line[16];
    while (fgets(line, sizeof line, stdin)) {
        struct timespec a, b;
        pthread_t started[256];
        uintptr_t hits = 0;
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (uintptr_t t = 0; t < (uintptr_t)threads; t++) pthread_create(&started[t], NULL, pass, (void *)t);
        for (int t = 0; t < threads; t++) {
            void *found;
            pthread_join(started[t], &found);
            hits += (uintptr_t)found;
        }
        clock_gettime(CLOCK_MONOTONIC, &b);
        printf("%.9f %lu\n", (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec), (unsigned long)hits);
        fflush(stdout);
    }
    return 0;
}
