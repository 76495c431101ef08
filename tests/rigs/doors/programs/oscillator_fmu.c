/* The oscillator as an FMU for co-simulation. FMI: 2 or 3. Other macros make it misbehave:
   FORGETS: a reset keeps the position; REFUSES: it cannot be reset; EVEN: all steps must be equal. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { POSITION, SPEED, FORCE, MASS, STIFFNESS, DAMPING, START, COUNT };
enum { OK = 0, DISCARD = 2, ERROR = 3, FATAL = 4 };

#if FMI == 2
typedef void (*Log)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Log logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished;
    void *environment;
} Callbacks;
#else
typedef void (*Log)(void *, int, const char *, const char *);
#endif

typedef struct {
    double x[COUNT], slope, first;
    int begun;
    Log log;
    void *environment;
} Model;

static void as_new(Model *m) {
    const double start[COUNT] = {0.1, 0.0, 0.0, 1.0, 20.0, 0.3, 0.1};
    memcpy(m->x, start, sizeof start);
    m->slope = m->first = 0.0;
    m->begun = 0;
}

static int failed(Model *m, int status, const char *words) {
#if FMI == 2
    m->log(m->environment, "oscillator", status, "error", "%s", words);
#else
    m->log(m->environment, status, "error", words);
#endif
    return status;
}

static int started(Model *m) {
    m->begun = 1;
#ifdef FORGETS
    static int times;
    if (times++ == 0)
#endif
    m->x[POSITION] = m->x[START];
    m->x[SPEED] = 0.0;
    if (m->x[STIFFNESS] > 60.0) return failed(m, FATAL, "the solver is gone");
    if (m->x[STIFFNESS] > 50.0) return failed(m, ERROR, "stiffness is outside the table");
    return OK;
}

static void rate(const Model *m, const double *y, double u, double *d) {
    d[0] = y[1];
    d[1] = (u - m->x[DAMPING] * y[1] - m->x[STIFFNESS] * y[0]) / m->x[MASS];
}

static int stepped(Model *m, double step) {
#ifdef EVEN
    if (m->first == 0.0) m->first = step;
    if (fabs(step - m->first) > 1e-9 * step) return failed(m, ERROR, "steps must be equal");
#endif
    int parts = (int)ceil(step / 1e-3);
    double h = step / parts, *y = m->x;
    for (int j = 0; j < parts; j++) {
        double u = m->x[FORCE], w = m->slope * h, a[2], b[2], c[2], d[2], s[2];
        rate(m, y, u, a);
        for (int n = 0; n < 2; n++) s[n] = y[n] + h / 2 * a[n];
        rate(m, s, u + w / 2, b);
        for (int n = 0; n < 2; n++) s[n] = y[n] + h / 2 * b[n];
        rate(m, s, u + w / 2, c);
        for (int n = 0; n < 2; n++) s[n] = y[n] + h * c[n];
        rate(m, s, u + w, d);
        for (int n = 0; n < 2; n++) y[n] += h / 6 * (a[n] + 2 * b[n] + 2 * c[n] + d[n]);
        m->x[FORCE] = u + w;
    }
    m->slope = 0.0;
    return m->x[STIFFNESS] > 45.0 ? failed(m, DISCARD, "the step is too long") : OK;
}

static int get(Model *m, const unsigned *vr, size_t n, double *values) {
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= COUNT) return ERROR;
        values[k] = m->x[vr[k]];
    }
    return OK;
}

static int set(Model *m, const unsigned *vr, size_t n, const double *values) {
    for (size_t k = 0; k < n; k++) {
        if (vr[k] >= COUNT || (m->begun && vr[k] != FORCE)) return failed(m, ERROR, "it cannot be set now");
        m->x[vr[k]] = values[k];
    }
    return OK;
}

static int reset(Model *m) {
#ifdef REFUSES
    return failed(m, ERROR, "no reset");
#endif
    double position = m->x[POSITION];
    as_new(m);
#ifdef FORGETS
    m->x[POSITION] = position;
#else
    (void)position;
#endif
    return OK;
}

/* Functions that every FMU must have, though this one needs none of them. */
#define NONE(name) int name(void) { return ERROR; }

#if FMI == 2
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *place, const Callbacks *f, int v, int l) {
    (void)name, (void)place, (void)v, (void)l;
    if (type != 1 || strcmp(guid, "{oscillator}")) return NULL;
    Model *m = f->allocate(1, sizeof *m);
    m->log = f->logger;
    m->environment = f->environment;
    as_new(m);
    return m;
}
void fmi2FreeInstance(void *m) { free(m); }
int fmi2SetupExperiment(void *m, int a, double b, double c, int d, double e) {
    (void)m, (void)a, (void)b, (void)c, (void)d, (void)e;
    return OK;
}
int fmi2EnterInitializationMode(void *m) { (void)m; return OK; }
int fmi2ExitInitializationMode(void *m) { return started(m); }
int fmi2Terminate(void *m) { (void)m; return OK; }
int fmi2Reset(void *m) { return reset(m); }
int fmi2GetReal(void *m, const unsigned *vr, size_t n, double *values) { return get(m, vr, n, values); }
int fmi2SetReal(void *m, const unsigned *vr, size_t n, const double *values) { return set(m, vr, n, values); }
int fmi2SetRealInputDerivatives(void *m, const unsigned *vr, size_t n, const int *order, const double *values) {
    for (size_t k = 0; k < n; k++) {
        if (vr[k] != FORCE || order[k] != 1) return ERROR;
        ((Model *)m)->slope = values[k];
    }
    return OK;
}
int fmi2DoStep(void *m, double time, double step, int keep) {
    (void)time, (void)keep;
    return stepped(m, step);
}
NONE(fmi2CancelStep) NONE(fmi2DeSerializeFMUstate) NONE(fmi2FreeFMUstate) NONE(fmi2GetBoolean)
NONE(fmi2GetBooleanStatus) NONE(fmi2GetDirectionalDerivative) NONE(fmi2GetFMUstate) NONE(fmi2GetInteger)
NONE(fmi2GetIntegerStatus) NONE(fmi2GetRealOutputDerivatives) NONE(fmi2GetRealStatus) NONE(fmi2GetStatus)
NONE(fmi2GetString) NONE(fmi2GetStringStatus) NONE(fmi2GetTypesPlatform) NONE(fmi2GetVersion)
NONE(fmi2SerializeFMUstate) NONE(fmi2SerializedFMUstateSize) NONE(fmi2SetBoolean) NONE(fmi2SetDebugLogging)
NONE(fmi2SetFMUstate) NONE(fmi2SetInteger) NONE(fmi2SetString)
#else
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *place, bool v, bool l, bool e, bool r,
                                  const unsigned *required, size_t n, void *environment, Log log, void *update) {
    (void)name, (void)place, (void)v, (void)l, (void)e, (void)r, (void)required, (void)n, (void)update;
    if (strcmp(token, "{oscillator}")) return NULL;
    Model *m = calloc(1, sizeof *m);
    m->log = log;
    m->environment = environment;
    as_new(m);
    return m;
}
void fmi3FreeInstance(void *m) { free(m); }
int fmi3EnterInitializationMode(void *m, bool a, double b, double c, bool d, double e) {
    (void)m, (void)a, (void)b, (void)c, (void)d, (void)e;
    return OK;
}
int fmi3ExitInitializationMode(void *m) { return started(m); }
int fmi3Terminate(void *m) { (void)m; return OK; }
int fmi3Reset(void *m) { return reset(m); }
int fmi3GetFloat64(void *m, const unsigned *vr, size_t n, double *values, size_t k) {
    return k == n ? get(m, vr, n, values) : ERROR;
}
int fmi3SetFloat64(void *m, const unsigned *vr, size_t n, const double *values, size_t k) {
    return k == n ? set(m, vr, n, values) : ERROR;
}
int fmi3DoStep(void *m, double time, double step, bool keep, bool *event, bool *end, bool *early, double *reached) {
    (void)keep;
    *event = *end = *early = false;
    *reached = time + step;
    return stepped(m, step);
}
NONE(fmi3ActivateModelPartition) NONE(fmi3CompletedIntegratorStep) NONE(fmi3DeserializeFMUState)
NONE(fmi3EnterConfigurationMode) NONE(fmi3EnterContinuousTimeMode) NONE(fmi3EnterEventMode) NONE(fmi3EnterStepMode)
NONE(fmi3EvaluateDiscreteStates) NONE(fmi3ExitConfigurationMode) NONE(fmi3FreeFMUState)
NONE(fmi3GetAdjointDerivative) NONE(fmi3GetBinary) NONE(fmi3GetBoolean) NONE(fmi3GetClock)
NONE(fmi3GetContinuousStateDerivatives) NONE(fmi3GetContinuousStates) NONE(fmi3GetDirectionalDerivative)
NONE(fmi3GetEventIndicators) NONE(fmi3GetFMUState) NONE(fmi3GetFloat32) NONE(fmi3GetInt16) NONE(fmi3GetInt32)
NONE(fmi3GetInt64) NONE(fmi3GetInt8) NONE(fmi3GetIntervalDecimal) NONE(fmi3GetIntervalFraction)
NONE(fmi3GetNominalsOfContinuousStates) NONE(fmi3GetNumberOfContinuousStates) NONE(fmi3GetNumberOfEventIndicators)
NONE(fmi3GetNumberOfVariableDependencies) NONE(fmi3GetOutputDerivatives) NONE(fmi3GetShiftDecimal)
NONE(fmi3GetShiftFraction) NONE(fmi3GetString) NONE(fmi3GetUInt16) NONE(fmi3GetUInt32) NONE(fmi3GetUInt64)
NONE(fmi3GetUInt8) NONE(fmi3GetVariableDependencies) NONE(fmi3GetVersion) NONE(fmi3InstantiateModelExchange)
NONE(fmi3InstantiateScheduledExecution) NONE(fmi3SerializeFMUState) NONE(fmi3SerializedFMUStateSize)
NONE(fmi3SetBinary) NONE(fmi3SetBoolean) NONE(fmi3SetClock) NONE(fmi3SetContinuousStates) NONE(fmi3SetDebugLogging)
NONE(fmi3SetFMUState) NONE(fmi3SetFloat32) NONE(fmi3SetInt16) NONE(fmi3SetInt32) NONE(fmi3SetInt64) NONE(fmi3SetInt8)
NONE(fmi3SetIntervalDecimal) NONE(fmi3SetIntervalFraction) NONE(fmi3SetShiftDecimal) NONE(fmi3SetShiftFraction)
NONE(fmi3SetString) NONE(fmi3SetTime) NONE(fmi3SetUInt16) NONE(fmi3SetUInt32) NONE(fmi3SetUInt64) NONE(fmi3SetUInt8)
NONE(fmi3UpdateDiscreteStates)
#endif
