#include "cpu.h"

const char *grouser_cpu_level(void) {
#if GROUSER_CLONED
  if (__builtin_cpu_supports("x86-64-v4")) return "x86-64-v4";
  if (__builtin_cpu_supports("x86-64-v3")) return "x86-64-v3";
#endif
  return "portable";
}
