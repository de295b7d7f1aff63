/* Feeds the exported loop with numbers drawn to do harm: STEPS SEED LIMIT. Prints what it saw as JSON. */
#include <stdio.h>
#include <stdlib.h>

#include "arm.h"

static uint64_t word;

static uint64_t drawn(void) {
  word ^= word << 13;
  word ^= word >> 7;
  word ^= word << 17;
  return word;
}

static double harmful(double usual) {
  uint64_t r = drawn();
  double x;
  switch (r & 63) {
    case 0: return (double)NAN;
    case 1: return (double)INFINITY;
    case 2: return -(double)INFINITY;
    case 3: return 1e308;
    case 4: return -1e308;
    case 5: return 4e-324;
    case 6: return -0.0;
    case 7: return 1e150;
    case 8: r = drawn(); memcpy(&x, &r, sizeof x); return x; /* any bits */
    case 9: return usual * 1e6;
    default: return usual;
  }
}

static double uniform(void) { return (double)(drawn() >> 11) * 0x1p-53; }

int main(int argc, char **argv) {
  long steps = atol(argv[1]), beyond = 0, leaks = 0, codes[16] = {0};
  double limit = atof(argv[3]), position[ARM_JOINTS], applied[ARM_JOINTS], other[ARM_JOINTS], force[ARM_JOINTS];
  double phase = 0.0;
  arm_state a, b;
  (void)argc;
  word = 88172645463325252u + (uint64_t)atol(argv[2]) * 7919u;
  arm_init(&a);
  arm_init(&b);
  for (long k = 0; k < steps; k++) {
    int calm = (int)((k >> 14) & 1); /* quiet stretches, so that torque builds up between */
    double dt = calm || (drawn() & 15) ? 1e-3 : harmful(1e-3 * (1.0 + 20.0 * uniform()));
    phase += 1e-3;
    if ((k & 0xfffff) == 0) phase = 0.0;
    for (int j = 0; j < ARM_JOINTS; j++) {
      double q = 0.3 * sin(phase * (1.0 + j)), u = uniform() - 0.5;
      int harm = !calm && (drawn() & 7) == 0;
      /* joint 0 is harmed in the one loop only */
      other[j] = position[j] = harm && j ? harmful(q) : q;
      force[j] = applied[j] = harm && j ? harmful(u) : u;
      if (harm && j) {
        a.joint[j].known = b.joint[j].known = harmful(0.5);
        a.joint[j].temperature = b.joint[j].temperature = harmful(30.0);
        a.joint[j].load = b.joint[j].load = harmful(1.0);
        a.joint[j].error = b.joint[j].error = harmful(0.01);
      } else {
        a.joint[j].known = b.joint[j].known = 0.0;
        a.joint[j].temperature = b.joint[j].temperature = 20.0;
        a.joint[j].load = b.joint[j].load = 0.0;
        a.joint[j].error = b.joint[j].error = 0.0;
      }
    }
    if (!calm && (drawn() & 7) == 0) {
      position[0] = harmful(position[0]);
      applied[0] = harmful(applied[0]);
      a.joint[0].known = harmful(0.1);
    }
    arm_step(&a, position, applied, dt);
    arm_step(&b, other, force, dt);
    for (int j = 0; j < ARM_JOINTS; j++) {
      double f = a.joint[j].torque, g = b.joint[j].torque;
      codes[a.code[j]]++;
      if (!(f >= -limit && f <= limit)) beyond++;
      if (!(g >= -limit && g <= limit)) beyond++;
    }
    for (int j = 1; j < ARM_JOINTS; j++) {
      if (memcmp(&a.joint[j], &b.joint[j], sizeof a.joint[j]) != 0) leaks++;
    }
    if ((drawn() & 0xffff) == 0) {
      arm_acknowledge(&a);
      arm_acknowledge(&b);
    }
    if ((drawn() & 0xfffff) == 0) {
      arm_stop(&a);
      arm_stop(&b);
    }
  }
  printf("{\"steps\": %ld, \"beyond\": %ld, \"leaks\": %ld, \"codes\": [", 2 * steps, beyond, leaks);
  for (int c = 0; c < 10; c++) printf("%s%ld", c ? ", " : "", codes[c]);
  printf("]}\n");
  return 0;
}
