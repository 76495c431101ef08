/* FMI 3.0 for co-simulation, around the compiled functions of a calibrated model.

   The names and types of the interface are those of the FMI standard, version 3.0 (Modelica Association). The model is
   one block of memory, whose image is part of this library, and one function, wingfit_run. A
   header, model.h, which the export writes, has the tables: variables, limits, addresses and laws. */

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Mode;
typedef enum { FLOAT, BOOLEAN, COUNT } Type;
typedef enum { INPUT, PARAMETER, TUNABLE, OUTPUT } Causality;
typedef void (*Logger)(void *environment, Status status, const char *category, const char *message);

typedef struct { int64_t word; Type type; Causality causality; const char *name; double least, most; } Variable;
typedef struct { int64_t word; double low, high; const char *name, *unit; } Limit;
typedef void (*Law)(int64_t *frame, int64_t moment);

/* WORDS, FIRST_CHANGING, TOKEN, TIME_REFERENCE, FIRST_REFERENCE, EXTRAPOLATE; VARIABLES, LIMITS, ADDRESSES, LAWS with
   their counts; LAW_FUNCTIONS */
#include "model.h"

extern const double wingfit_image[];
__asm__(".section .rodata\n.balign 64\n.globl wingfit_image\nwingfit_image:\n.incbin \"memory.bin\"\n.previous\n");

/* numba's convention: a result, an error that is not used, then the arguments; not zero if memory is exhausted */
int32_t wingfit_run(int64_t *result, void **error, int64_t memory, double dt);

typedef struct {
    char *name;
    Logger logger;
    void *environment;
    bool logs, stale;
    Mode mode;
    double time;
    double *memory;
} Instance;

typedef struct { uint64_t token; double time; int64_t mode, stale; double words[WORDS - FIRST_CHANGING]; } Saved;

/* -- memory of arrays within the compiled functions, which numba's runtime would provide -------------------------- */

typedef struct { size_t references; void (*destroy)(void *, size_t, void *); void *info, *data; size_t size; void *with; }
    Block;

Block *NRT_MemInfo_alloc_aligned(size_t size, uint32_t align) {
    Block *block = malloc(sizeof(Block) + size + align);
    if (block == NULL) return NULL;
    uintptr_t data = (uintptr_t)(block + 1);
    *block = (Block){.references = 1, .data = (void *)(data + (align - data % align) % align), .size = size};
    return block;
}

void NRT_MemInfo_call_dtor(Block *block) {
    if (block->destroy != NULL) block->destroy(block->data, block->size, block->info);
    free(block);
}

void *NRT_Allocate(size_t size) { return malloc(size); }
void NRT_Free(void *block) { free(block); }

/* -- the model ----------------------------------------------------------------------------------------------------- */

static Status said(Instance *own, Status status, const char *format, ...) {
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (own->logger != NULL) own->logger(own->environment, status, status == DISCARD ? "logStatusDiscard" : "logStatusError", text);
    return status;
}

static void fresh(Instance *own) {
    memcpy(own->memory, wingfit_image, sizeof(double) * WORDS);
    int64_t *words = (int64_t *)own->memory;
    for (size_t k = 0; k < ADDRESS_COUNT; k++) words[ADDRESSES[k][0]] = (int64_t)(own->memory + ADDRESSES[k][1]);
    for (size_t k = 0; k < LAW_COUNT; k++) words[LAWS[k][0]] = (int64_t)LAW_FUNCTIONS[LAWS[k][1]];
    own->mode = INSTANTIATED;
    own->stale = true;
    own->time = 0.0;
}

static Status outputs_of_now(Instance *own) {
    if (!own->stale || own->mode == TERMINATED) return OK;
    int64_t result = 0;
    void *error = NULL;
    if (wingfit_run(&result, &error, (int64_t)own->memory, 0.0)) return said(own, ERROR, "memory is exhausted");
    own->stale = false;
    return OK;
}

/* Whether the inputs are numbers, within the conditions to which the model was fitted. */
static Status within(Instance *own, Status refusal) {
    for (size_t k = 0; k < VARIABLE_COUNT; k++) {
        const Variable *one = &VARIABLES[k];
        double value = own->memory[one->word];
        if (one->causality != OUTPUT && !(value >= one->least && value <= one->most))
            return said(own, refusal, "%s is %g; it must lie in [%g, %g]: set another value", one->name, value, one->least, one->most);
    }
    if (own->memory[EXTRAPOLATE] != 0.0) return OK;
    for (size_t k = 0; k < LIMIT_COUNT; k++) {
        const Limit *one = &LIMITS[k];
        double value = own->memory[one->word], margin = 1e-6 * fmax(fmax(fabs(one->low), fabs(one->high)), 1e-3);
        if (value < one->low - margin || value > one->high + margin)
            return said(own, refusal, "%s is %.9g %s; the model was fitted from %.9g to %.9g %s: set it within this range, "
                        "or set the parameter extrapolate to true if you accept an extrapolation",
                        one->name, value, one->unit, one->low, one->high, one->unit);
    }
    return OK;
}

static Status advance(Instance *own, double dt) {
    int64_t result = 0;
    void *error = NULL;
    if (wingfit_run(&result, &error, (int64_t)own->memory, dt)) return said(own, ERROR, "memory is exhausted");
    if (result != 0)
        return said(own, ERROR, "the wing diverged between %g s and %g s: a body turned more than 1 rad within one step. "
                    "It flutters, or steps_per_beat is too small", own->time, own->time + dt);
    return OK;
}

static const Variable *found(Instance *own, uint32_t reference, Type type) {
    if (reference < FIRST_REFERENCE || reference >= FIRST_REFERENCE + VARIABLE_COUNT) {
        said(own, ERROR, "there is no variable with the value reference %u", (unsigned)reference);
        return NULL;
    }
    const Variable *one = &VARIABLES[reference - FIRST_REFERENCE];
    if (one->type == type) return one;
    said(own, ERROR, "variable %s has another type", one->name);
    return NULL;
}

static Status settable(Instance *own, const Variable *one) {
    bool before = own->mode == INSTANTIATED || own->mode == INITIALIZING;
    if (one->causality == OUTPUT) return said(own, ERROR, "%s is an output; it cannot be set", one->name);
    if (one->causality == PARAMETER && !before)
        return said(own, ERROR, "%s is a fixed parameter; set it before the simulation starts", one->name);
    if (before) own->stale = true;
    return OK;
}

/* -- FMI: creation, initialization, steps --------------------------------------------------------------------------- */

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void fmi3FreeInstance(void *instance) {
    Instance *own = instance;
    if (own == NULL) return;
    free(own->memory);
    free(own->name);
    free(own);
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
        bool logs, bool events, bool early, const uint32_t *required, size_t count, void *environment, Logger logger,
        void *update) {
    (void)resources, (void)visible, (void)events, (void)early, (void)required, (void)count, (void)update;
    Instance probe = {.environment = environment, .logger = logger};
    if (token == NULL || strcmp(token, TOKEN) != 0) {
        said(&probe, ERROR, "the instantiation token is not that of this FMU");
        return NULL;
    }
    Instance *own = calloc(1, sizeof(Instance));
    if (own == NULL) return NULL;
    own->memory = aligned_alloc(64, (sizeof(double) * WORDS + 63) / 64 * 64);
    own->name = calloc(strlen(name == NULL ? "" : name) + 1, 1);
    if (own->memory == NULL || own->name == NULL) {
        fmi3FreeInstance(own);
        return NULL;
    }
    strcpy(own->name, name == NULL ? "" : name);
    own->environment = environment, own->logger = logger, own->logs = logs;
    fresh(own);
    return own;
}

EXPORT Status fmi3SetDebugLogging(void *instance, bool on, size_t count, const char *const *categories) {
    (void)count, (void)categories;
    ((Instance *)instance)->logs = on;
    return OK;
}

EXPORT Status fmi3EnterInitializationMode(void *instance, bool tolerant, double tolerance, double start, bool stops,
        double stop) {
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    Instance *own = instance;
    if (own->mode != INSTANTIATED) return said(own, ERROR, "the FMU is initialized already; reset it first");
    own->mode = INITIALIZING;
    own->time = start;
    return OK;
}

EXPORT Status fmi3ExitInitializationMode(void *instance) {
    Instance *own = instance;
    if (own->mode != INITIALIZING) return said(own, ERROR, "initialization mode has not been entered");
    Status status = within(own, ERROR);
    if (status == OK) status = outputs_of_now(own);
    if (status == OK) own->mode = STEPPING;
    return status;
}

EXPORT Status fmi3DoStep(void *instance, double time, double dt, bool final, bool *events, bool *ends, bool *early,
        double *last) {
    (void)final;
    Instance *own = instance;
    *events = *ends = *early = false;
    *last = own->time;
    if (own->mode != STEPPING) return said(own, ERROR, "the FMU is not initialized, or is terminated");
    if (!(dt > 0.0) || !isfinite(time + dt)) return said(own, ERROR, "the step is %g s; it must be positive", dt);
    Status status = within(own, DISCARD);
    if (status != OK) return status;
    status = advance(own, dt);
    if (status != OK) {
        own->mode = TERMINATED;
        return status;
    }
    own->time = *last = time + dt;
    return OK;
}

EXPORT Status fmi3Terminate(void *instance) {
    ((Instance *)instance)->mode = TERMINATED;
    return OK;
}

EXPORT Status fmi3Reset(void *instance) {
    fresh(instance);
    return OK;
}

/* -- FMI: variables ----------------------------------------------------------------------------------------------- */

EXPORT Status fmi3GetFloat64(void *instance, const uint32_t *references, size_t count, double *values, size_t size) {
    Instance *own = instance;
    if (size != count || outputs_of_now(own) != OK) return ERROR;
    for (size_t k = 0; k < count; k++) {
        if (references[k] == TIME_REFERENCE) {
            values[k] = own->time;
            continue;
        }
        const Variable *one = found(own, references[k], FLOAT);
        if (one == NULL) return ERROR;
        values[k] = own->memory[one->word];
    }
    return OK;
}

EXPORT Status fmi3SetFloat64(void *instance, const uint32_t *references, size_t count, const double *values, size_t size) {
    Instance *own = instance;
    if (size != count) return ERROR;
    for (size_t k = 0; k < count; k++) {
        const Variable *one = found(own, references[k], FLOAT);
        if (one == NULL || settable(own, one) != OK) return ERROR;
        own->memory[one->word] = values[k];
    }
    return OK;
}

#define ACCESS(NAME, C_TYPE, TYPE)                                                                                      \
    EXPORT Status fmi3Get##NAME(void *instance, const uint32_t *references, size_t count, C_TYPE *values, size_t size) { \
        if (size != count) return ERROR;                                                                                \
        for (size_t k = 0; k < count; k++) {                                                                            \
            const Variable *one = found(instance, references[k], TYPE);                                                 \
            if (one == NULL) return ERROR;                                                                              \
            values[k] = (C_TYPE)((Instance *)instance)->memory[one->word];                                              \
        }                                                                                                               \
        return OK;                                                                                                      \
    }                                                                                                                   \
    EXPORT Status fmi3Set##NAME(void *instance, const uint32_t *references, size_t count, const C_TYPE *values,         \
            size_t size) {                                                                                              \
        if (size != count) return ERROR;                                                                                \
        for (size_t k = 0; k < count; k++) {                                                                            \
            const Variable *one = found(instance, references[k], TYPE);                                                 \
            if (one == NULL || settable(instance, one) != OK) return ERROR;                                             \
            ((Instance *)instance)->memory[one->word] = (double)values[k];                                              \
        }                                                                                                               \
        return OK;                                                                                                      \
    }
ACCESS(Boolean, bool, BOOLEAN)
ACCESS(Int32, int32_t, COUNT)

/* -- FMI: states --------------------------------------------------------------------------------------------------- */

EXPORT Status fmi3GetFMUState(void *instance, void **state) {
    Instance *own = instance;
    Saved *saved = *state != NULL ? *state : malloc(sizeof(Saved));
    if (saved == NULL) return said(own, ERROR, "memory is exhausted");
    *saved = (Saved){.token = TOKEN_NUMBER, .time = own->time, .mode = own->mode, .stale = own->stale};
    memcpy(saved->words, own->memory + FIRST_CHANGING, sizeof saved->words);
    *state = saved;
    return OK;
}

EXPORT Status fmi3SetFMUState(void *instance, void *state) {
    Instance *own = instance;
    const Saved *saved = state;
    if (saved == NULL) return said(own, ERROR, "there is no state to restore");
    memcpy(own->memory + FIRST_CHANGING, saved->words, sizeof saved->words);
    own->time = saved->time, own->mode = (Mode)saved->mode, own->stale = saved->stale != 0;
    return OK;
}

EXPORT Status fmi3FreeFMUState(void *instance, void **state) {
    (void)instance;
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT Status fmi3SerializedFMUStateSize(void *instance, void *state, size_t *size) {
    (void)instance, (void)state;
    *size = sizeof(Saved);
    return OK;
}

EXPORT Status fmi3SerializeFMUState(void *instance, void *state, uint8_t *bytes, size_t size) {
    if (state == NULL || size < sizeof(Saved)) return said(instance, ERROR, "the state needs %zu bytes", sizeof(Saved));
    memcpy(bytes, state, sizeof(Saved));
    return OK;
}

EXPORT Status fmi3DeserializeFMUState(void *instance, const uint8_t *bytes, size_t size, void **state) {
    Saved *saved = *state != NULL ? *state : malloc(sizeof(Saved));
    if (saved == NULL) return said(instance, ERROR, "memory is exhausted");
    if (size == sizeof(Saved)) memcpy(saved, bytes, sizeof(Saved));
    if (size != sizeof(Saved) || saved->token != TOKEN_NUMBER) {
        if (*state == NULL) free(saved);
        return said(instance, ERROR, "the %zu bytes are not a state of this FMU", size);
    }
    *state = saved;
    return OK;
}

/* -- FMI: what the FMU does not have -------------------------------------------------------------------------------- */

#define ABSENT(NAME)                                                                          \
    EXPORT Status fmi3##NAME(void *instance) {                                                 \
        return said(instance, ERROR, "fmi3" #NAME " is not supported: see modelDescription.xml"); \
    }
#define ABSENT_TYPE(NAME) ABSENT(Get##NAME) ABSENT(Set##NAME)

EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }
ABSENT_TYPE(Float32) ABSENT_TYPE(Int8) ABSENT_TYPE(UInt8) ABSENT_TYPE(Int16) ABSENT_TYPE(UInt16) ABSENT_TYPE(UInt32)
ABSENT_TYPE(Int64) ABSENT_TYPE(UInt64) ABSENT_TYPE(String) ABSENT_TYPE(Binary) ABSENT_TYPE(Clock)
ABSENT_TYPE(IntervalDecimal) ABSENT_TYPE(IntervalFraction) ABSENT_TYPE(ShiftDecimal) ABSENT_TYPE(ShiftFraction)
ABSENT(EnterEventMode) ABSENT(EnterStepMode) ABSENT(EnterConfigurationMode) ABSENT(ExitConfigurationMode)
ABSENT(GetNumberOfVariableDependencies) ABSENT(GetVariableDependencies) ABSENT(GetDirectionalDerivative)
ABSENT(GetAdjointDerivative) ABSENT(EvaluateDiscreteStates) ABSENT(UpdateDiscreteStates) ABSENT(GetOutputDerivatives)
ABSENT(ActivateModelPartition) ABSENT(EnterContinuousTimeMode) ABSENT(CompletedIntegratorStep) ABSENT(SetTime)
ABSENT(SetContinuousStates) ABSENT(GetContinuousStateDerivatives) ABSENT(GetEventIndicators) ABSENT(GetContinuousStates)
ABSENT(GetNominalsOfContinuousStates) ABSENT(GetNumberOfEventIndicators) ABSENT(GetNumberOfContinuousStates)
