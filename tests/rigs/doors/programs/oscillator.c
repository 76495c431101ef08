/* A program of someone else: reads one request, integrates the oscillator with fourth order, and writes CSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PARTS = 20, MOST = 100000 };

static const char *text;

static const char *after(const char *name) {
    const char *at = strstr(text, name);
    if (!at) {
        fprintf(stderr, "the request has no %s\n", name);
        exit(2);
    }
    return at + strlen(name);
}

static int list(const char *name, double *values) {
    char *at = (char *)after(name);
    int count = 0;
    at = strchr(at, '[') + 1;
    while (*at != ']' && count < MOST) {
        values[count++] = strtod(at, &at);
        at += strspn(at, ", ");
    }
    return count;
}

static double k, c, m;

static void rate(const double *y, double u, double *d) {
    d[0] = y[1];
    d[1] = (u - c * y[1] - k * y[0]) / m;
}

static void moved(const double *y, double h, const double *d, double *out) {
    out[0] = y[0] + h * d[0];
    out[1] = y[1] + h * d[1];
}

int main(void) {
    static char buffer[1 << 22];
    static double times[MOST], force[MOST];
    buffer[fread(buffer, 1, sizeof buffer - 1, stdin)] = 0;
    text = buffer;
    k = strtod(after("\"stiffness\":"), NULL);
    c = strtod(after("\"damping\":"), NULL);
    m = strtod(after("\"mass\":"), NULL);
    if (k > 39.0) {
        fprintf(stderr, "stiffness %g N/m is outside the table\n", k);
        return 4;
    }
    double y[2] = {strtod(after("\"start\":"), NULL), 0.0};
    int count = list("\"times\":", times);
    list("\"force\":", force);
    printf("time,position,speed\n%.17g,%.17g,%.17g\n", times[0], y[0], y[1]);
    for (int i = 0; i + 1 < count; i++) {
        double h = (times[i + 1] - times[i]) / PARTS, slope = (force[i + 1] - force[i]) / PARTS;
        for (int j = 0; j < PARTS; j++) {
            double u = force[i] + slope * j, a[2], b[2], e[2], f[2], s[2];
            rate(y, u, a);
            moved(y, h / 2, a, s);
            rate(s, u + slope / 2, b);
            moved(y, h / 2, b, s);
            rate(s, u + slope / 2, e);
            moved(y, h, e, s);
            rate(s, u + slope, f);
            for (int n = 0; n < 2; n++) y[n] += h / 6 * (a[n] + 2 * b[n] + 2 * e[n] + f[n]);
        }
        printf("%.17g,%.17g,%.17g\n", times[i + 1], y[0], y[1]);
    }
    return 0;
}
