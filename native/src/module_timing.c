#include <string.h>
#include <time.h>

#include "module.h"

static double now_ns(void) {
  struct timespec t;
  timespec_get(&t, TIME_UTC);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* Every call takes a little of the last one's force into its row, so that none can begin before the last has ended. */
PyObject *grouser_object_time_calls(PyObject *self, PyObject *const *arguments, Py_ssize_t count) {
  const grouser_kernel *kernel = &((grouser_kernel_object *)self)->kernel;
  if (count != 3) {
    PyErr_SetString(PyExc_TypeError, "time_calls takes rows, a number of calls and whether to want the jacobian");
    return NULL;
  }
  const long calls = PyLong_AsLong(arguments[1]);
  const int want_jacobian = PyObject_IsTrue(arguments[2]);
  if (PyErr_Occurred()) return NULL;
  grouser_array x;
  if (grouser_array_acquire(arguments[0], "x", kernel->columns, 0, &x) < 0) return NULL;
  PyObject *result = NULL;
  if (calls < 1 || x.rows < 1) {
    PyErr_SetString(PyExc_ValueError, "time_calls needs at least one row and one call");
  } else if (!grouser_kernel_refuses(kernel, &x)) {
    double row[GROUSER_MAX_COLUMNS], forces[GROUSER_OUTPUTS] = {0, 0, 0}, begin, end;
    double jacobian[GROUSER_OUTPUTS * GROUSER_MAX_COLUMNS];
    Py_BEGIN_ALLOW_THREADS
    begin = now_ns();
    for (long call = 0; call < calls; call++) {
      memcpy(row, x.data + (call % x.rows) * kernel->columns, sizeof(double) * (size_t)kernel->columns);
      row[GROUSER_VX] += 1e-300 * forces[0];
      kernel->evaluate(kernel->self, row, forces, want_jacobian ? jacobian : NULL);
    }
    end = now_ns();
    Py_END_ALLOW_THREADS
    result = PyFloat_FromDouble((end - begin) / (double)calls);
  }
  grouser_array_release(&x);
  return result;
}
