/* A small importer of FMU 3.0, in C: a process in which there is no Python.

   driver LIBRARY TOKEN STEP COUNT OUTPUT,... [INPUT=VALUE ...]
   steps an instance COUNT times and prints the outputs after every step, as hexadecimal floats. Halfway it saves and
   serializes the state; at the end it restores it into a second instance and repeats the second half. The last lines
   say "identical" or "different", and "python" or "no python" by the libraries that the process has loaded. */

#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef int Status;
typedef void (*Logger)(void *, Status, const char *, const char *);
static void *library;

static void *symbol(const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) {
        fprintf(stderr, "no symbol %s\n", name);
        exit(2);
    }
    return found;
}

static void logged(void *environment, Status status, const char *category, const char *message) {
    (void)environment;
    fprintf(stderr, "%d %s: %s\n", status, category, message);
}

static void checked(Status status, const char *call) {
    if (status != 0) {
        fprintf(stderr, "%s returned %d\n", call, status);
        exit(2);
    }
}

static void *instance(const char *token) {
    void *(*make)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *,
                  Logger, void *) = symbol("fmi3InstantiateCoSimulation");
    void *made = make("driver", token, NULL, false, true, false, false, NULL, 0, NULL, logged, NULL);
    if (made == NULL) exit(2);
    return made;
}

static void steps(void *fmu, int from, int to, double dt, const uint32_t *references, size_t count, double *values,
                  bool print) {
    Status (*step)(void *, double, double, bool, bool *, bool *, bool *, double *) = symbol("fmi3DoStep");
    Status (*get)(void *, const uint32_t *, size_t, double *, size_t) = symbol("fmi3GetFloat64");
    for (int k = from; k < to; k++) {
        bool events, ends, early;
        double last;
        checked(step(fmu, k * dt, dt, false, &events, &ends, &early, &last), "fmi3DoStep");
        checked(get(fmu, references, count, values + (size_t)k * count, count), "fmi3GetFloat64");
        for (size_t i = 0; print && i < count; i++) printf("%a%c", values[(size_t)k * count + i], i + 1 < count ? ' ' : '\n');
    }
}

static bool has_python(void) {
    char line[4096];
    bool found = false;
    FILE *maps = fopen("/proc/self/maps", "r");
    while (maps != NULL && fgets(line, sizeof line, maps) != NULL) found = found || strstr(line, "python") != NULL;
    if (maps != NULL) fclose(maps);
    return found;
}

int main(int argc, char **argv) {
    if (argc < 6) return 2;
    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    double dt = atof(argv[3]);
    int count = atoi(argv[4]);
    uint32_t references[4096];
    size_t outputs = 0;
    for (char *part = strtok(argv[5], ","); part != NULL; part = strtok(NULL, ",")) references[outputs++] = (uint32_t)atoi(part);
    Status (*set)(void *, const uint32_t *, size_t, const double *, size_t) = symbol("fmi3SetFloat64");
    Status (*enter)(void *, bool, double, double, bool, double) = symbol("fmi3EnterInitializationMode");
    Status (*leave)(void *) = symbol("fmi3ExitInitializationMode");
    void *fmu = instance(argv[2]);
    for (int k = 6; k < argc; k++) {
        uint32_t reference = (uint32_t)atoi(argv[k]);
        double value = atof(strchr(argv[k], '=') + 1);
        checked(set(fmu, &reference, 1, &value, 1), "fmi3SetFloat64");
    }
    checked(enter(fmu, false, 0.0, 0.0, false, 0.0), "fmi3EnterInitializationMode");
    checked(leave(fmu), "fmi3ExitInitializationMode");
    double *values = calloc((size_t)count * outputs, sizeof(double)), *again = calloc((size_t)count * outputs, sizeof(double));
    steps(fmu, 0, count / 2, dt, references, outputs, values, true);

    Status (*save)(void *, void **) = symbol("fmi3GetFMUState");
    Status (*measure)(void *, void *, size_t *) = symbol("fmi3SerializedFMUStateSize");
    Status (*pack)(void *, void *, uint8_t *, size_t) = symbol("fmi3SerializeFMUState");
    Status (*unpack)(void *, const uint8_t *, size_t, void **) = symbol("fmi3DeserializeFMUState");
    Status (*restore)(void *, void *) = symbol("fmi3SetFMUState");
    Status (*drop)(void *, void **) = symbol("fmi3FreeFMUState");
    void (*release)(void *) = symbol("fmi3FreeInstance");
    void *state = NULL, *copy = NULL;
    size_t size = 0;
    checked(save(fmu, &state), "fmi3GetFMUState");
    checked(measure(fmu, state, &size), "fmi3SerializedFMUStateSize");
    uint8_t *bytes = malloc(size);
    checked(pack(fmu, state, bytes, size), "fmi3SerializeFMUState");
    checked(drop(fmu, &state), "fmi3FreeFMUState");
    steps(fmu, count / 2, count, dt, references, outputs, values, true);
    release(fmu);

    void *other = instance(argv[2]);
    checked(enter(other, false, 0.0, 0.0, false, 0.0), "fmi3EnterInitializationMode");
    checked(leave(other), "fmi3ExitInitializationMode");
    checked(unpack(other, bytes, size, &copy), "fmi3DeserializeFMUState");
    checked(restore(other, copy), "fmi3SetFMUState");
    checked(drop(other, &copy), "fmi3FreeFMUState");
    steps(other, count / 2, count, dt, references, outputs, again, false);
    release(other);
    size_t from = (size_t)(count / 2) * outputs, length = (size_t)(count - count / 2) * outputs * sizeof(double);
    printf("%s\n%s\n", memcmp(values + from, again + from, length) == 0 ? "identical" : "different",
           has_python() ? "python" : "no python");
    free(values), free(again), free(bytes);
    return 0;
}
