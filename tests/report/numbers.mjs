// Prints numbers as the page shows them, all digits of those that it shortens, and the number of ticks between neighbouring numbers.
import { allDigits, text, ticks } from "../../report_page/src/numbers.js";

const shown = [1234567, 123456789012, 0.12345678, -3, null].map(text);
const whole = [1234567, 0.12345678, 0.123456, -1234567.8, "0.12345678", null].map((value) => allDigits(value) ?? null);
const counts = [[-0.30000000000000004, -0.3], [1e16, 1e16 + 2], [0, 0]].map(([low, high]) => ticks(low, high, 5).length);
process.stdout.write(JSON.stringify({ shown, whole, counts, ticks: [ticks(-0.31, 0.42, 5), ticks(3, 1003, 5)] }));
