/* Which vector level the hot loops are compiled for and run at. */
#ifndef GROUSER_CPU_H
#define GROUSER_CPU_H

#include <limits.h> /* any header of the C library says whether it is glibc */

/* Clones need gcc's function multiversioning and an ifunc-capable loader; elsewhere the portable code runs alone. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__linux__) && defined(__GLIBC__)
#define GROUSER_CLONED 1
#define GROUSER_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define GROUSER_CLONED 0
#define GROUSER_CLONES
#endif

/* "x86-64-v4", "x86-64-v3" or "portable". */
const char *grouser_cpu_level(void);

#endif
